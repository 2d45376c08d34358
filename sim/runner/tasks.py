"""Tasks with results that are kept: each is keyed by all that decides it, in one SQLite file.

A task names a module's function and plain arguments, and returns arrays by name. Its key is a digest of the sources
of this program (every module, so that no edit is missed), of the versions of the packages it stands on, of the files
the task reads, of the function and of its arguments.
"""

import functools
import hashlib
import importlib
import importlib.util
import io
import json
import sqlite3
import time
import zipfile
from collections.abc import Callable, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from sim.errors import UserError
from sim.log import provenance
from sim.runner.pool import Ended, Pool

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ("controller/**/*.py", "sim/**/*.py", "models/*/*.xml", "models/*/*.urdf", "models/*/gaits/*.toml")
"""Files whose change makes every stored result stale."""

FILE = "results.sqlite"
PRINTED = "workers.log"
"""Beside the results: what workers print."""

Arrays = dict[str, NDArray[Any]]
Progress = Callable[[float, float], None]
"""Told the cost done and the cost in all."""


class Stopped(Exception):
    """The user asked to stop."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """A piece of work for a worker process; equal tasks have equal results and are run once.

    Attributes:
        function: "module:function", which returns arrays by name.
        arguments: Its arguments; plain values.
        cost: Rough effort, for the time left: simulated seconds, those under C-MPC counted several times.
        files: Files it reads beside those of `SOURCES`.
    """

    function: str
    arguments: Mapping[str, Any]
    cost: float = 1.0
    files: tuple[str, ...] = ()


class TaskStore:
    """Results in a folder, a row a task."""

    def __init__(self, folder: Path) -> None:
        """Open a folder, which is made when missing.

        Raises:
            UserError: it cannot be written, or holds something else.
        """
        self.folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UserError(f"--out {folder.parent}: cannot be written: {error.strerror}") from error
        with self._as_user_error():
            self._db = sqlite3.connect(folder / FILE, isolation_level=None, timeout=30.0)
            self._db.execute("PRAGMA journal_mode = WAL")
            self._db.execute("PRAGMA synchronous = NORMAL")
            self._db.execute("CREATE TABLE IF NOT EXISTS results (key TEXT PRIMARY KEY, task TEXT, arrays BLOB)")
            self._db.execute("CREATE TABLE IF NOT EXISTS times (key TEXT PRIMARY KEY, cpu_s REAL)")

    @contextmanager
    def _as_user_error(self) -> Any:
        try:
            yield
        except sqlite3.DatabaseError as error:
            raise UserError(f"{self.folder / FILE}: {error}; must be a writable file of results, or none") from error

    @staticmethod
    def key(task: Task) -> str:
        """Digest of all that decides the result of a task."""
        module = importlib.util.find_spec(task.function.partition(":")[0])
        own = Path(module.origin).read_bytes() if module and module.origin else b""
        digest = hashlib.sha256(_fingerprint().encode() + hashlib.sha256(own).digest())
        digest.update(json.dumps([task.function, dict(task.arguments)], sort_keys=True).encode())
        for file in task.files:
            digest.update(hashlib.sha256(Path(file).read_bytes()).digest())
        return digest.hexdigest()

    def get(self, task: Task) -> Arrays | None:
        """The stored result of a task, None if there is none (or a damaged one)."""
        with self._as_user_error():
            row = self._db.execute("SELECT arrays FROM results WHERE key = ?", (self.key(task),)).fetchone()
        if row is None:
            return None
        try:
            with np.load(io.BytesIO(row[0]), allow_pickle=False) as data:
                return {name: data[name] for name in data.files}
        except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile):
            return None

    def cpu(self, task: Task) -> float:
        """CPU time that a task took when it was run in [s], NaN where that is not known."""
        with self._as_user_error():
            row = self._db.execute("SELECT cpu_s FROM times WHERE key = ?", (self.key(task),)).fetchone()
        return float(row[0]) if row else float("nan")

    def put(self, task: Task, result: Mapping[str, NDArray[Any]], cpu: float = float("nan")) -> None:
        """Keep a result, safe from then on.

        Args:
            task: Whose it is.
            result: Arrays by name.
            cpu: CPU time it took in [s].

        Raises:
            UserError: the disk is full or the file cannot be written.
        """
        data = io.BytesIO()
        np.savez_compressed(data, **result)  # type: ignore[arg-type]
        row = (self.key(task), task.function, data.getvalue())
        with self._as_user_error():
            self._db.execute("INSERT OR REPLACE INTO results VALUES (?, ?, ?)", row)
            self._db.execute("INSERT OR REPLACE INTO times VALUES (?, ?)", (row[0], cpu))

    def close(self) -> None:
        """Close the file."""
        self._db.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


@functools.cache
def _fingerprint() -> str:
    digest = hashlib.sha256(json.dumps(provenance.package_versions(), sort_keys=True).encode())
    for pattern in SOURCES:
        for file in sorted(ROOT.glob(pattern)):
            digest.update(file.relative_to(ROOT).as_posix().encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()


def run_tasks(
    tasks: Mapping[str, Task],
    store: TaskStore,
    *,
    workers: int,
    progress: Progress | None = None,
    finished: Callable[[str], None] | None = None,
    stop: Callable[[], str | None] = lambda: None,
) -> None:
    """Run those tasks that have no stored result yet.

    Args:
        tasks: Tasks by name; equal ones are run once.
        store: Where results are looked for and kept.
        workers: Number of processes, 1 or more.
        progress: Told how far it is after every task.
        finished: Told the name of every task once its result is stored.
        stop: Asked a few times a second; a reason ends the run.

    Raises:
        Stopped: `stop` gave a reason; what is finished is stored.
        UserError: a task's input is not legal, it ended its process, or the store cannot be written.
        RuntimeError: a task raised: a defect.
    """
    total = sum(task.cost for task in tasks.values())
    done = 0.0
    report = progress or (lambda *_: None)

    def close(names: list[str]) -> None:
        nonlocal done
        done += sum(tasks[name].cost for name in names)
        for name in names:
            if finished:
                finished(name)
        report(done, total)

    groups: dict[str, list[str]] = {}
    for name, task in tasks.items():
        groups.setdefault(store.key(task), []).append(name)
    missing: dict[str, list[str]] = {}
    for names in groups.values():
        if store.get(tasks[names[0]]) is not None:
            close(names)
        else:
            missing[names[0]] = names
    report(done, total)
    # The longest first, so that no worker is left alone with one at the end.
    order = sorted(missing, key=lambda name: -tasks[name].cost)
    with Pool(_work, dict(tasks), workers=workers, log=str(store.folder / PRINTED)) as pool:
        for end in pool.run(order, stop):
            if end.how is Ended.CRASHED:
                raise UserError(f"task {end.argument}: {end.message}; what is finished is kept")
            if end.how is not Ended.DONE:
                raise RuntimeError(f"task {end.argument}: {end.message}\n{end.detail}")
            store.put(tasks[end.argument], *end.value)
            close(missing.pop(end.argument))
    if missing:
        raise Stopped(stop() or "stopped")


def _work(tasks: Mapping[str, Task], name: str) -> tuple[Arrays, float]:
    began = time.process_time()
    return work(tasks[name]), time.process_time() - began


def work(task: Task) -> Arrays:
    """Run a task in this process."""
    module, _, function = task.function.partition(":")
    found: Arrays = getattr(importlib.import_module(module), function)(**task.arguments)
    return found

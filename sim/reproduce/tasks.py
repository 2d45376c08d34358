"""Runs tasks in worker processes and keeps their results, so that an interrupted reproduction goes on."""

import hashlib
import importlib
import json
import os
from collections.abc import Callable, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.errors import UserError
from sim.log import provenance
from sim.reproduce.study import Task

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ("controller/**/*.py", "sim/**/*.py", "models/*/*.xml", "models/*/*.urdf", "models/*/gaits/*.toml")
"""Files whose change makes every stored result stale; so does that of the task's own module."""

SLICE = 0.2  # [s] between looks at the clock

Progress = Callable[[float, float], None]
"""Told the cost done and the cost in all."""


class Stopped(Exception):
    """The user asked to stop."""


class Store:
    """Results on disk, a file a task, named by a hash of all that decides them."""

    def __init__(self, folder: Path) -> None:
        """Open a folder, which is made when missing.

        Raises:
            UserError: it cannot be written.
        """
        self.folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UserError(f"--out {folder.parent}: cannot be written: {error.strerror}") from error
        self._base = _fingerprint()

    def path(self, task: Task) -> Path:
        """Where the result of a task is or will be."""
        module = ROOT / (task.function.partition(":")[0].replace(".", "/") + ".py")
        parts = (
            self._base,
            module.read_bytes().hex(),
            task.function,
            json.dumps(dict(task.arguments), sort_keys=True),
        )
        return self.folder / (hashlib.sha256("\n".join(parts).encode()).hexdigest()[:32] + ".npz")

    def get(self, task: Task) -> dict[str, NDArray[Any]] | None:
        """The stored result of a task, None if there is none (or a damaged one)."""
        try:
            with np.load(self.path(task), allow_pickle=False) as data:
                return {name: data[name] for name in data.files}
        except (OSError, ValueError, EOFError, KeyError):
            return None
        except Exception as error:
            if type(error).__name__ == "BadZipFile":
                return None
            raise

    def put(self, task: Task, result: Mapping[str, NDArray[Any]]) -> None:
        """Keep a result; the file appears whole or not at all."""
        path = self.path(task)
        part = path.with_suffix(f".{os.getpid()}.part")
        try:
            with part.open("wb") as file:
                np.savez_compressed(file, **result)  # type: ignore[arg-type]
            part.replace(path)
        except OSError as error:
            raise UserError(f"--out {self.folder.parent}: cannot be written: {error.strerror}") from error


def _fingerprint() -> str:
    digest = hashlib.sha256(json.dumps(provenance.package_versions(), sort_keys=True).encode())
    for pattern in SOURCES:
        for file in sorted(ROOT.glob(pattern)):
            digest.update(file.relative_to(ROOT).as_posix().encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()


def run(
    tasks: Mapping[str, Task],
    store: Store,
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
        workers: Number of processes, 1 or more; one runs in this process.
        progress: Told how far it is, a few times a second.
        finished: Told the name of every task once its result is stored.
        stop: Asked between tasks, and a few times a second while workers are busy; a reason ends the run.

    Raises:
        Stopped: `stop` gave a reason; what is finished is stored.
        UserError: a task's input is not legal, or the store cannot be written.
    """
    total = sum(task.cost for task in tasks.values())
    done = 0.0
    groups: dict[Path, list[str]] = {}
    for name, task in tasks.items():
        groups.setdefault(store.path(task), []).append(name)
    missing: dict[str, list[str]] = {}
    for path, names in groups.items():
        if path.is_file() and store.get(tasks[names[0]]) is not None:
            done += _close(names, tasks, finished)
        else:
            missing[names[0]] = names
    # The longest first, so that no worker is left alone with one at the end.
    missing = dict(sorted(missing.items(), key=lambda item: -tasks[item[0]].cost))
    report = progress or (lambda *_: None)
    report(done, total)
    if workers == 1:
        for name, names in missing.items():
            _heed(stop)
            store.put(tasks[name], work(tasks[name]))
            done += _close(names, tasks, finished)
            report(done, total)
        return
    if not missing:
        return
    _one_thread_each()
    pool = ProcessPoolExecutor(
        min(workers, len(missing)),
        mp_context=get_context("spawn"),
        initializer=_prepare,
        initargs=(store.folder / "workers.log",),
    )
    try:
        running: dict[Future[dict[str, NDArray[Any]]], str] = {pool.submit(work, tasks[name]): name for name in missing}
        while running:
            _heed(stop)
            ready, _ = wait(running, timeout=SLICE, return_when=FIRST_COMPLETED)
            for future in ready:
                name = running.pop(future)
                store.put(tasks[name], future.result())
                done += _close(missing[name], tasks, finished)
            report(done, total)
    except BaseException:
        for process in list((pool._processes or {}).values()):
            process.terminate()
        pool.shutdown(wait=False, cancel_futures=True)
        raise
    pool.shutdown()


def _heed(stop: Callable[[], str | None]) -> None:
    reason = stop()
    if reason:
        raise Stopped(reason)


def _close(names: list[str], tasks: Mapping[str, Task], finished: Callable[[str], None] | None) -> float:
    """Tell that these tasks are done; returns their cost."""
    if finished:
        for name in names:
            finished(name)
    return sum(tasks[name].cost for name in names)


def work(task: Task) -> dict[str, NDArray[Any]]:
    """Run a task in this process."""
    module, _, function = task.function.partition(":")
    found: dict[str, NDArray[Any]] = getattr(importlib.import_module(module), function)(**task.arguments)
    return found


def _one_thread_each() -> None:
    """Children inherit it: two libraries with two threads each would only be in each other's way."""
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ.setdefault(variable, "1")


def _prepare(log: Path) -> None:
    """Leave Ctrl-C to the parent, which ends its workers, and take what solvers print to a file."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with log.open("ab") as file:
        for descriptor in (1, 2):
            os.dup2(file.fileno(), descriptor)

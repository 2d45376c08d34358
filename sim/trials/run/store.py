"""The results database: one SQLite file, written by one process, a row a trial.

Each result is a transaction of its own in a write-ahead log, so a killed campaign loses the trials in flight
and nothing else; the primary key makes a doubled trial impossible.
"""

import dataclasses
import json
import shutil
import sqlite3
import tempfile
import types
import typing
import urllib.parse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from sim.errors import UserError
from sim.trials.plan import Plan
from sim.trials.plan import plan as plans
from sim.trials.run.origin import origin_key
from sim.trials.run.result import WITH_RESULT, TrialResult

VERSION = 3
"""Version of the tables; no other is read."""

LOG_PAGES = 100
"""Pages of the write-ahead log, of 4 KiB, after which it is folded into the file; a result takes two or three."""

_FIELDS = tuple(field.name for field in dataclasses.fields(TrialResult))
_SQL_TYPES = {int: "INTEGER", bool: "INTEGER", float: "REAL", str: "TEXT"}


def _column(name: str, hint: Any) -> str:
    kinds = [kind for kind in typing.get_args(hint) or (hint,) if kind is not types.NoneType]
    optional = len(kinds) < len(typing.get_args(hint) or (hint,))
    return f'"{name}" {_SQL_TYPES[kinds[0]]}' + ("" if optional else " NOT NULL")


_HINTS = typing.get_type_hints(TrialResult)
_CREATE = (
    "CREATE TABLE trials ("
    + ", ".join(_column(name, _HINTS[name]) for name in _FIELDS)
    + ", PRIMARY KEY (controller, trial)) WITHOUT ROWID"
)
_ACCEPTED: dict[Any, tuple[type, ...]] = {float: (int, float), bool: (int,)}
_KINDS = {
    name: tuple(kind for one in typing.get_args(hint) or (hint,) for kind in _ACCEPTED.get(one, (one,)))
    for name, hint in _HINTS.items()
}
_INSERT = f"INSERT INTO trials VALUES ({', '.join('?' * len(_FIELDS))})"


_KNOWN = f"outcome IN ({', '.join(repr(outcome) for outcome in WITH_RESULT)})"


@dataclass(frozen=True, slots=True, kw_only=True)
class Counts:
    """How many trials ended how.

    Attributes:
        survived: Those that survived.
        known: Those with a result: survived or fallen.
        done: All, those without a result included.
    """

    survived: int = 0
    known: int = 0
    done: int = 0

    @property
    def fell(self) -> int:
        """Those that fell."""
        return self.known - self.survived

    @property
    def unknown(self) -> int:
        """Those without a result."""
        return self.done - self.known


class Store:
    """Results of one plan in one folder."""

    def __init__(self, path: Path | None, *, write: bool = False) -> None:
        """Open or create the database.

        Args:
            path: The file; None for results that live in memory.
            write: Whether results will be added.

        Raises:
            UserError: it cannot be opened, is no results database, or is of another version.
        """
        self._where = str(path) if path else "results in memory"
        self._origins: set[str] = set()
        if path and not write and not path.is_file():
            raise UserError(f"{path}: no results there; run cmpc trials PLAN --out {path.parent} first")
        with self._as_user_error():
            self._db = _writable(path) if write else _readable(path)
            if write:
                self._db.execute("PRAGMA journal_mode = WAL")
                self._db.execute("PRAGMA synchronous = NORMAL")
                self._db.execute(f"PRAGMA wal_autocheckpoint = {LOG_PAGES}")
            version = self._db.execute("PRAGMA user_version").fetchone()[0]
            if version not in (0, VERSION):
                advice = "use a newer one, or another --out" if version > VERSION else "run them again, with --restart"
                raise UserError(f"{path}: results of version {version}; this program reads {VERSION}: {advice}")
            if version == 0 and not write:
                raise UserError(f"{path}: holds no results; must be the results of a campaign")
            if version == 0:
                self._create()

    def _create(self) -> None:
        tables = self._db.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
        if tables:
            raise UserError(f"{self._where}: is a database, but not of results")
        self._db.execute("BEGIN")
        self._db.execute("CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL)")
        self._db.execute("CREATE TABLE origins (key TEXT PRIMARY KEY, facts TEXT NOT NULL)")
        self._db.execute(_CREATE)
        self._db.execute(f"PRAGMA user_version = {VERSION}")
        self._db.execute("COMMIT")

    @contextmanager
    def _as_user_error(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.OperationalError as error:
            raise UserError(f"{self._where}: {error}; results so far are kept") from error
        except sqlite3.DatabaseError as error:
            raise UserError(f"{self._where}: {error}: must be the results of a campaign") from error

    def plan(self) -> Plan | None:
        """The plan the results belong to, None before there is one."""
        with self._as_user_error():
            row = self._db.execute("SELECT value FROM meta WHERE key = 'plan'").fetchone()
        if row and not isinstance(row[0], str):
            raise UserError(f"{self._where}: its plan is damaged: must be TOML text")
        return plans.from_toml(row[0], f"plan stored in {self._where}", trusted=False) if row else None

    def set_plan(self, plan: Plan) -> None:
        """Remember the plan, instead of one that was."""
        rows = {"plan": plans.to_toml(plan), "plan_hash": plan.hash()}
        with self._as_user_error():
            self._db.executemany("INSERT OR REPLACE INTO meta VALUES (?, ?)", rows.items())

    def add(self, result: TrialResult, origin: str = "") -> None:
        """Keep a result, safe from then on.

        Args:
            result: The result.
            origin: What it ran with, as JSON.

        Raises:
            UserError: the disk is full or the file cannot be written.
        """
        key = origin_key(origin) if origin else ""
        with self._as_user_error():
            if key not in self._origins:
                self._db.execute("INSERT OR IGNORE INTO origins VALUES (?, ?)", (key, origin))
                self._origins.add(key)
            values = (key if name == "origin" else getattr(result, name) for name in _FIELDS)
            self._db.execute(_INSERT, tuple(values))

    def origins(self) -> dict[str, str]:
        """What the results were found with, as JSON, by the key that is in their rows."""
        with self._as_user_error():
            return dict(self._db.execute("SELECT key, facts FROM origins WHERE key IN (SELECT origin FROM trials)"))

    def origins_of(self, controller: str) -> list[str]:
        """What the results of a controller were found with, as JSON."""
        query = "SELECT facts FROM origins WHERE key IN (SELECT DISTINCT origin FROM trials WHERE controller = ?)"
        with self._as_user_error():
            return [facts for (facts,) in self._db.execute(query, (controller,)) if facts]

    def criteria(self) -> list[dict[str, float]]:
        """What the results were judged by, each set of criteria once; more than one where the walker's size varies."""
        query = "SELECT DISTINCT judged_by FROM trials WHERE judged_by != '' ORDER BY judged_by"
        with self._as_user_error():
            found = [text for (text,) in self._db.execute(query)]
        try:
            return [{str(name): float(value) for name, value in json.loads(text).items()} for text in found]
        except (ValueError, TypeError, AttributeError) as error:
            raise UserError(f"{self._where}: a row is damaged: judged_by: {error}") from error

    def forget(self, outcomes: Sequence[str]) -> int:
        """Remove the results with these outcomes; their number."""
        marks = ", ".join("?" * len(outcomes))
        with self._as_user_error():
            return self._db.execute(f"DELETE FROM trials WHERE outcome IN ({marks})", tuple(outcomes)).rowcount

    def done(self) -> set[tuple[str, int]]:
        """(controller, trial) of every result."""
        with self._as_user_error():
            return set(self._db.execute("SELECT controller, trial FROM trials"))

    def survivals(self, controller: str, first: int, last: int) -> dict[int, bool]:
        """Whether the trials from `first` up to but not with `last` survived, by trial; only those with a result."""
        query = f"SELECT trial, survived FROM trials WHERE {_KNOWN} AND controller = ? AND trial >= ? AND trial < ?"
        with self._as_user_error():
            return {trial: bool(survived) for trial, survived in self._db.execute(query, (controller, first, last))}

    def results(self, controller: str | None = None, first: int = 0, last: int = 2**62) -> Iterator[TrialResult]:
        """Results in order of controller and trial."""
        query = "SELECT * FROM trials WHERE trial >= ? AND trial < ?"
        bounds: tuple[Any, ...] = (first, last)
        if controller is not None:
            query, bounds = f"{query} AND controller = ?", (*bounds, controller)
        with self._as_user_error():
            for row in self._db.execute(query + " ORDER BY controller, trial", bounds):
                yield self._result(row)

    def _result(self, row: Sequence[Any]) -> TrialResult:
        """A row as a result.

        Raises:
            UserError: it is damaged.
        """
        try:
            values = dict(zip(_FIELDS, row, strict=True))
            for name, kinds in _KINDS.items():
                if not isinstance(values[name], kinds):
                    raise ValueError(f"{name} = {values[name]!r}")
            found = TrialResult(**values | {"survived": bool(values["survived"])})
            for text in (found.values, found.evidence or "{}", found.judged_by or "{}"):
                if not isinstance(json.loads(text), dict):
                    raise ValueError(text)
            _ = found.proof, found.least_speed_m_s
        except (ValueError, KeyError, TypeError) as error:
            words = " ".join(str(error).split())[:100]
            raise UserError(f"{self._where}: the row of trial {row[0]}/{row[1]} is damaged: {words}") from error
        return found

    def result(self, controller: str, trial: int) -> TrialResult | None:
        """One result, None if there is none yet."""
        return next(self.results(controller, trial, trial + 1), None)

    def counts(self) -> dict[str, Counts]:
        """How many trials ended how, by controller."""
        query = f"SELECT controller, sum(survived), sum({_KNOWN}), count(*) FROM trials GROUP BY controller"
        with self._as_user_error():
            return {
                name: Counts(survived=survived, known=known, done=done)
                for name, survived, known, done in self._db.execute(query)
            }

    def close(self) -> None:
        """Close the file; the write-ahead log is folded into it and goes."""
        self._db.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _writable(path: Path | None) -> sqlite3.Connection:
    return sqlite3.connect(path or ":memory:", isolation_level=None)


def _readable(path: Path | None) -> sqlite3.Connection:
    """Open for reading, on a disk that cannot be written too, and whether or not a campaign is writing."""
    place = f"file:{urllib.parse.quote(str(path))}"
    try:
        found = sqlite3.connect(f"{place}?mode=ro", uri=True, isolation_level=None)
        found.execute("SELECT count(*) FROM sqlite_master").fetchone()
    except sqlite3.OperationalError:
        if _log_of(path).is_file():  # of a campaign that was killed: it has results that the file lacks
            with tempfile.TemporaryDirectory() as folder:
                for file in (Path(str(path)), _log_of(path)):
                    shutil.copy(file, folder)
                there = sqlite3.connect(Path(folder) / Path(str(path)).name)
                found = sqlite3.connect(":memory:", isolation_level=None)
                there.backup(found)
                there.close()
            return found
        found = sqlite3.connect(f"{place}?mode=ro&immutable=1", uri=True, isolation_level=None)
    return found


def _log_of(path: Path | None) -> Path:
    return Path(f"{path}-wal")

"""A log as one frame a channel: columns by name, each with its unit.

from sim.review import load

run = load("logs/push-25N.mcap")
control = run["/control"]
control.t, control["u_total.left_hip"], control.units["u_total.left_hip"]
"""

import json
from array import array
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.Log_pb2 import Log as LogMessage
from numpy.typing import NDArray

from sim.errors import UserError
from sim.log.format.layout import HEADER
from sim.log.format.seal import KEY as SIGNATURE
from sim.log.format.topics import EVENTS
from sim.log.read.log import Log, time_ns
from sim.log.read.reader import read_log

_OWN = ("_tick", "_time_ns", "_publish_ns")  # what an MCAP message carries besides its fields
MOST_COLUMNS = 2000
MOST_CELLS = 10_000_000  # of a channel with series: a minute of walking has 1 million


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Frame(Mapping[str, NDArray[Any]]):
    """One channel: a mapping from dotted field name to column.

    Attributes:
        topic: Its topic.
        tick: Tick of each row, (n,).
        t: Time since the start of the run in [s], (n,).
        units: Unit of each column; "1" for a pure number, empty for flags and words.
        descriptions: Meaning of each column.
        enums: Words for the codes of a column that holds such.
    """

    topic: str
    tick: NDArray[np.int64]
    t: NDArray[np.float64]
    units: Mapping[str, str]
    descriptions: Mapping[str, str]
    enums: Mapping[str, Mapping[int, str]]
    _columns: Mapping[str, NDArray[Any]]

    def __getitem__(self, name: str) -> NDArray[Any]:
        """A column, (n,).

        Raises:
            UserError: there is none of that name.
        """
        if name not in self._columns:
            raise UserError(f"{self.topic} has no column {name!r}; it has {', '.join(self._columns)}")
        return self._columns[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    def __contains__(self, name: object) -> bool:
        return name in self._columns

    def to_pandas(self) -> Any:
        """A pandas DataFrame indexed by time in [s]; pandas must be installed."""
        import pandas

        return pandas.DataFrame(dict(self), index=pandas.Index(self.t, name="t [s]"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """Something that happened.

    Attributes:
        t: When, in [s] since the start of the run.
        level: "debug", "info", "warning", "error" or "fatal".
        name: What kind.
        message: One line for people.
    """

    t: float
    level: str
    name: str
    message: str


class Frames(Mapping[str, Frame]):
    """Topic -> frame, of every channel that is a table; each is decoded when it is first asked for."""

    def __init__(self, log: Log) -> None:
        """Args: log: where the messages are."""
        self._log = log
        self._fixed = {topic: log.has_layout(topic) for topic in log.channels}
        self._topics = [t for t, fixed in self._fixed.items() if fixed or (log.is_own(t) and log.units(t))]
        self._known: dict[str, Frame] = {}

    def __getitem__(self, topic: str) -> Frame:
        """The frame of a channel.

        Raises:
            UserError: there is none of that topic, or it is no table.
        """
        if topic not in self._topics:
            raise UserError(f"{self._log.path}: no frame {topic!r}; there are {', '.join(self._topics)}")
        if topic not in self._known:
            self._known[topic] = (_fixed_frame if self._fixed[topic] else _series_frame)(self._log, topic)
        return self._known[topic]

    def __iter__(self) -> Iterator[str]:
        return iter(self._topics)

    def __len__(self) -> int:
        return len(self._topics)

    def __contains__(self, topic: object) -> bool:
        return topic in self._topics


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Run:
    """A log as frames.

    Attributes:
        log: The log itself.
        frames: Topic -> frame, of every channel that is a table.
        events: Events in order of time.
    """

    log: Log
    frames: Frames = field(repr=False)
    events: tuple[Event, ...] = field(repr=False)

    def __repr__(self) -> str:
        """One line."""
        about, result = self.about, self.result
        words = (
            about.get("scenario", "a log"),
            result.get("outcome", "not finished"),
            f"{result.get('steps', '?')} steps",
        )
        return f"<{self.log.path}: {', '.join(map(str, words))}>"

    def __getitem__(self, topic: str) -> Frame:
        """The frame of a channel.

        Raises:
            UserError: there is none of that topic, or it is no table.
        """
        return self.frames[topic]

    @property
    def about(self) -> dict[str, str]:
        """What was said about the run before its first tick: scenario, seed, versions, git revision."""
        return self.log.metadata.get("run", {})

    @property
    def result(self) -> dict[str, Any]:
        """The figures of the run, as `cmpc run --json` prints them; empty if it did not end."""
        texts = self.log.metadata.get("result", {})
        return {key: parsed(text) for key, text in texts.items() if key != SIGNATURE}

    @property
    def scenario_toml(self) -> str:
        """The scenario as TOML."""
        return self.log.attachments.get("scenario.toml", ("", b""))[1].decode("utf-8", "replace")


def parsed(text: str) -> Any:
    """A value from JSON, or the text itself where it is none."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return text


def load(path: Path | str) -> Run:
    """Load a log.

    Args:
        path: The MCAP file.

    Raises:
        UserError: it cannot be read or is damaged.
    """
    return run_of(read_log(path))


def run_of(log: Log) -> Run:
    """The frames of a log that is in memory."""
    return Run(log=log, frames=Frames(log), events=tuple(events_of(log)) if log.is_own(EVENTS) else ())


def _fixed_frame(log: Log, topic: str) -> Frame:
    rows = log.channel(topic)
    columns = {name: np.ascontiguousarray(rows[name]) for name in rows.dtype.names or () if name not in _OWN}
    return _frame(log, topic, rows["_tick"], rows["_time_ns"], columns)


def _series_frame(log: Log, topic: str) -> Frame:
    """A channel with series in its messages: a column for each place, `y.stance_hip[0]`."""
    values: dict[str, array[float]] = {}
    ticks, times = [], []
    for row, (record, message) in enumerate(log.decoded(topic)):
        ticks.append(int.from_bytes(record[11:15], "little"))
        times.append(time_ns(record))
        for name, value in _flat(message, ""):
            column = values.setdefault(name, array("d"))
            column.extend([np.nan] * (row - len(column)))
            column.append(value)
        if len(values) > MOST_COLUMNS or len(values) * row > MOST_CELLS:
            raise UserError(f"{log.path}: {topic} has more than {MOST_COLUMNS} columns or {MOST_CELLS} values")
    n = len(times)
    columns = {name: np.array(column + array("d", [np.nan] * (n - len(column)))) for name, column in values.items()}
    return _frame(log, topic, np.array(ticks, np.int64), np.array(times, np.uint64), columns)


def _flat(message: Any, prefix: str) -> Iterator[tuple[str, float]]:
    for entry in message.DESCRIPTOR.fields:
        value = getattr(message, entry.name)
        if entry.message_type is not None:
            if hasattr(value, "DESCRIPTOR"):
                yield from _flat(value, f"{prefix}{entry.name}.")
        elif isinstance(value, int | float):
            yield prefix + entry.name, value
        elif not isinstance(value, str | bytes):
            for index, item in enumerate(value[:MOST_COLUMNS]):
                if isinstance(item, int | float):
                    yield f"{prefix}{entry.name}[{index}]", item


def _frame(log: Log, topic: str, ticks: Any, times: Any, columns: dict[str, NDArray[Any]]) -> Frame:
    units, descriptions = log.units(topic), log.descriptions(topic)
    return Frame(
        topic=topic,
        tick=ticks.astype(np.int64),
        t=times.astype(np.float64) * 1e-9,
        units={name: units.get(name.partition("[")[0], "") for name in columns},
        descriptions={name: descriptions.get(name.partition("[")[0], "") for name in columns},
        enums={name: words for name, words in log.enums(topic).items() if name in columns},
        _columns=columns,
    )


def events_of(log: Log) -> Iterator[Event]:
    """Events of a log in order of time.

    Raises:
        UserError: one cannot be decoded, in a log that is read strictly.
    """
    levels = LogMessage.DESCRIPTOR.fields_by_name["level"].enum_type.values
    names = {value.number: value.name.lower() for value in levels}
    for record in log.records(EVENTS):
        try:
            message = LogMessage.FromString(record[HEADER:])
        except Exception as error:
            if log.tolerant:
                continue
            raise UserError(f"{log.path}: a message of {EVENTS} cannot be decoded: {error}") from error
        level = names.get(message.level, "unknown")
        yield Event(t=time_ns(record) * 1e-9, level=level, name=message.name, message=message.message)

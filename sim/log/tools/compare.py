"""Where two logs differ: first tick, channel and field, and the largest difference of each channel."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from foxglove_schemas_protobuf.Log_pb2 import Log as Event
from numpy.typing import NDArray

from sim.log.format.fields import CHANNELS
from sim.log.format.layout import HEADER
from sim.log.read import Log

PER_TICK = frozenset(channel.topic for channel in CHANNELS)
WALL_TIME = ("/timing",)
"""Channels that measure the machine; they differ between any two runs and are left out of the verdict."""


class Difference(NamedTuple):
    """Two values that differ.

    Attributes:
        tick: Where.
        topic: In which channel.
        field: In which field, empty for a message as a whole.
        a: Value in the first log, as text.
        b: Value in the second.
    """

    tick: int
    topic: str
    field: str
    a: str
    b: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChannelComparison:
    """One channel of two logs.

    Attributes:
        topic: Its topic.
        counts: Messages in the first and the second log, -1 where the channel is missing.
        first: The first difference, None if there is none.
        largest: Field -> largest difference of the ticks both have, in the field's unit; only those that differ.
        units: Unit of each field.
    """

    topic: str
    counts: tuple[int, int]
    first: Difference | None
    largest: dict[str, float]
    units: dict[str, str]

    @property
    def equal(self) -> bool:
        """Whether every message agrees to the last bit."""
        return self.first is None and self.counts[0] == self.counts[1]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Comparison:
    """Two logs.

    Attributes:
        channels: Every channel of either, those of `WALL_TIME` left out.
        attachments: Names of attachments that differ or are missing in one.
        sound: Whether both logs are whole and undamaged.
    """

    channels: tuple[ChannelComparison, ...]
    attachments: tuple[str, ...]
    sound: bool

    @property
    def first(self) -> Difference | None:
        """The earliest difference, None if there is none."""
        found = [channel.first for channel in self.channels if channel.first]
        return min(found, key=lambda d: d.tick, default=None)

    @property
    def identical(self) -> bool:
        """Whether both are sound and agree in every tick and every attachment."""
        return self.sound and bool(self.channels) and not self.attachments and all(c.equal for c in self.channels)


def compare(a: Log, b: Log, *, last_tick: int | None = None) -> Comparison:
    """Compare two logs tick by tick.

    Args:
        a: The one.
        b: The other.
        last_tick: Look no further than this tick, the last of a log that stops in the middle, whose events may
            be missing; None for all.
    """
    topics = [topic for topic in {**a.channels, **b.channels} if topic not in WALL_TIME]
    names = {**a.attachments, **b.attachments}
    return Comparison(
        channels=tuple(_channel(a, b, topic, last_tick) for topic in topics),
        attachments=tuple(name for name in names if a.attachments.get(name) != b.attachments.get(name)),
        sound=all(log.complete and not log.problems for log in (a, b)),
    )


def _channel(a: Log, b: Log, topic: str, last_tick: int | None) -> ChannelComparison:
    there = [topic in log.channels for log in (a, b)]
    if not all(there):
        counts = tuple(len(log.records(topic)) if found else -1 for log, found in zip((a, b), there, strict=True))
        missing = Difference(0, topic, "", _there(there[0]), _there(there[1]))
        return ChannelComparison(topic=topic, counts=(counts[0], counts[1]), first=missing, largest={}, units={})
    first: Difference | None
    if topic in PER_TICK and a.has_layout(topic) and b.has_layout(topic):
        rows_a, rows_b = _until(a.channel(topic), last_tick), _until(b.channel(topic), last_tick)
        first, largest = _compare_rows(topic, rows_a, rows_b)
        counts = (len(rows_a), len(rows_b))
    else:
        records = [
            [
                r
                for r in log.records(topic)
                if (last_tick is None or _tick(r) < last_tick) and not _is_headline(topic, r)
            ]
            for log in (a, b)
        ]
        first, largest = _compare_records(topic, records[0], records[1]), {}
        counts = (len(records[0]), len(records[1]))
    units = {**b.units(topic), **a.units(topic)}
    return ChannelComparison(topic=topic, counts=(counts[0], counts[1]), first=first, largest=largest, units=units)


def _is_headline(topic: str, record: bytes) -> bool:
    """Whether a message is the event that names scenario and versions: those are told apart elsewhere."""
    if topic != "/events":
        return False
    try:
        return bool(Event.FromString(record[HEADER:]).name == "run")
    except Exception:  # not readable: compared as bytes
        return False


def _until(rows: NDArray[Any], last_tick: int | None) -> NDArray[Any]:
    return rows if last_tick is None else rows[rows["_tick"] <= last_tick]


def _tick(record: bytes) -> int:
    return int.from_bytes(record[11:15], "little")


def _compare_rows(topic: str, a: NDArray[Any], b: NDArray[Any]) -> tuple[Difference | None, dict[str, float]]:
    ticks_a, ticks_b = a["_tick"], b["_tick"]
    if np.array_equal(ticks_a, ticks_b):
        ticks = ticks_a
    else:
        ticks, in_a, in_b = np.intersect1d(ticks_a, ticks_b, return_indices=True)
        a, b = a[in_a], b[in_b]
    first: Difference | None = None
    alone = np.setxor1d(ticks_a, ticks_b)
    if alone.size:
        tick = int(alone[0])
        first = Difference(tick, topic, "", _there(tick in ticks_a), _there(tick in ticks_b))
    largest = {}
    names = [name for name in a.dtype.names or () if not name.startswith("_") and name in (b.dtype.names or ())]
    for name in names:
        x, y = np.ascontiguousarray(a[name]), np.ascontiguousarray(b[name])
        if x.dtype != y.dtype:
            unequal: NDArray[Any] = np.ones(len(x), bool)
        else:
            unequal = (x.view(f"u{x.itemsize}") != y.view(f"u{y.itemsize}")).reshape(-1)
        if not unequal.any():
            continue
        where = int(np.argmax(unequal))
        with np.errstate(all="ignore"):
            gap = np.abs(x.astype(float) - y.astype(float))
        finite = gap[np.isfinite(gap)]
        largest[name] = float(finite.max()) if finite.size else float("inf")
        if first is None or ticks[where] < first.tick:
            first = Difference(int(ticks[where]), topic, name, repr(x[where].item()), repr(y[where].item()))
    if first is None and set(a.dtype.names or ()) != set(b.dtype.names or ()):
        odd = sorted(set(a.dtype.names or ()) ^ set(b.dtype.names or ()))[0]
        first = Difference(0, topic, odd, _there(odd in (a.dtype.names or ())), _there(odd in (b.dtype.names or ())))
    return first, largest


def _there(present: bool) -> str:
    return "present" if present else "missing"


def _compare_records(topic: str, a: Collection[bytes], b: Collection[bytes]) -> Difference | None:
    for x, y in zip(a, b, strict=False):
        if x[11:] != y[11:]:  # the channel id may differ
            return Difference(min(_tick(x), _tick(y)), topic, "", "a message", "another message")
    if len(a) != len(b):
        longer = list(a if len(a) > len(b) else b)
        tick = _tick(longer[min(len(a), len(b))])
        words = ("present", "missing") if len(a) > len(b) else ("missing", "present")
        return Difference(tick, topic, "", *words)
    return None

"""Where two logs differ: first tick, channel and field, and the largest difference of each channel."""

import contextlib
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from foxglove_schemas_protobuf.Log_pb2 import Log as Event
from numpy.typing import NDArray

from sim.errors import UserError
from sim.log.format.layout import HEADER
from sim.log.format.seal import KEY as SIGNATURE
from sim.log.format.topics import EVENTS, PER_TICK
from sim.log.read import Log
from sim.log.read.log import time_ns
from sim.log.tools.signed import signature_problems
from sim.log.tools.text import printable

WALL_TIME = ("/timing",)
"""Channels that measure the machine; they differ between any two runs and are left out of the verdict."""

MEASURED = ("solve_ms", "tick_ms", "realtime_factor", "log")
"""Figures of a summary that depend on the machine."""

SINCE = ("judged_by", "scuff_depth_m", "scuff_time_s")
"""Figures that logs written before they were invented do not have."""

SCUFF_SINCE = 2
UNKNOWN_EVENTS = frozenset(("scuff",))
"""Kinds of events that no log before format `SCUFF_SINCE` has."""

PROVENANCE = ("format", "versions", "git_revision", "git_dirty", "platform", "cpu", "blas", "kernels")
"""Entries of the metadata "run" that tell where and by what a log was recorded, not what ran."""


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
        channels: Every channel of this program that either has, those of `WALL_TIME` left out.
        attachments: Names of attachments that differ or are missing in one.
        metadata: What the logs say of run and result that differs, such as "result steps"; wall times left out.
        provenance: Where and by what they were recorded, as far as it differs.
        container: How the files hold the same messages, as far as it differs; a few words each.
        unsound: Why there is no verdict: damage, a wrong signature, an unknown format; a sentence each.
    """

    channels: tuple[ChannelComparison, ...]
    attachments: tuple[str, ...]
    metadata: tuple[str, ...]
    provenance: tuple[str, ...]
    container: tuple[str, ...]
    unsound: tuple[str, ...]

    @property
    def first(self) -> Difference | None:
        """The earliest difference, None if there is none."""
        return min((c.first for c in self.channels if c.first), key=lambda d: d.tick, default=None)

    @property
    def sound(self) -> bool:
        """Whether both logs are whole, undamaged and as they were signed."""
        return not self.unsound

    @property
    def same_ticks(self) -> bool:
        """Whether both are sound and agree in every message of this program."""
        return self.sound and bool(self.channels) and all(c.equal for c in self.channels)

    @property
    def same_run(self) -> bool:
        """Whether they agree in every attachment and in what they say of the run, too."""
        return self.same_ticks and not self.attachments and not self.metadata

    @property
    def identical(self) -> bool:
        """Whether the files hold the same run in the same way."""
        return self.same_run and not self.container

    @property
    def verdict(self) -> str:
        """The outcome in a few words."""
        if self.identical:
            return "identical (wall times left out)"
        if self.same_run:
            return f"same ticks, other container: {'; '.join(self.container)}"
        if self.same_ticks:
            names = [*(f"attachment {name}" for name in self.attachments), *self.metadata]
            return f"same ticks, but what the logs say of them differs: {', '.join(names)}"
        if not self.sound:
            return "no verdict: a log is damaged, was not finished or is not as it was signed"
        if self.first is None:
            return "different: no channel to compare"
        d = self.first
        return f"different: first at tick {d.tick}, {d.topic} {d.field}".rstrip() + f": {d.a} | {d.b}"


def compare(a: Log, b: Log, *, last_tick: int | None = None) -> Comparison:
    """Compare two logs tick by tick.

    Args:
        a: The one.
        b: The other.
        last_tick: Look no further than this tick, the last of a log that stops in the middle, whose events may
            be missing; None for all.
    """
    topics = [topic for topic in dict.fromkeys((*a.own, *b.own)) if topic not in WALL_TIME]
    names = {**a.attachments, **b.attachments}
    channels = tuple(_channel(a, b, topic, last_tick) for topic in topics)
    return Comparison(
        channels=channels,
        attachments=tuple(name for name in names if a.attachments.get(name) != b.attachments.get(name)),
        metadata=tuple(_metadata(a, b)),
        provenance=tuple(n for n in PROVENANCE if _said(a, "run").get(n) != _said(b, "run").get(n)),
        container=tuple(a.container.differences(b.container)),
        unsound=tuple(f"{log.path}: {words}" for log in (a, b) for words in _unsound(log)),
    )


def _unsound(log: Log) -> list[str]:
    """Why nothing certain can be said about a log."""
    if log.problems:
        return ["it is damaged"]
    if not log.complete:
        return ["it was not finished"]
    if log.unknown_format:
        return [f"it {log.unknown_format}"]
    unreadable = [t for t in log.own if t in PER_TICK and not log.has_layout(t)]
    bad = [f"the schema of {topic} cannot be read" for topic in unreadable]
    bad += [f"messages of {topic} do not match the schema" for topic, count in log.malformed.items() if count]
    return bad + signature_problems(log)


def _said(log: Log, name: str) -> dict[str, str]:
    return log.metadata.get(name, {})


def _metadata(a: Log, b: Log) -> list[str]:
    """Names of what the logs say of run and result that differs."""
    names = []
    for record, ignored in (("run", {*PROVENANCE, "started", "sha256"}), ("result", {*MEASURED, SIGNATURE})):
        one, other = _said(a, record), _said(b, record)
        for key in dict.fromkeys((*one, *other)):
            since = key in SINCE and (key not in one or key not in other)
            if key not in ignored and not since and one.get(key) != other.get(key):
                names.append(f"{record} {key}")
    return names


def _channel(a: Log, b: Log, topic: str, last_tick: int | None) -> ChannelComparison:
    there = [log.is_own(topic) for log in (a, b)]
    if not all(there):
        counts = tuple(len(log.records(topic)) if known else -1 for log, known in zip((a, b), there, strict=True))
        missing = Difference(0, topic, "", _there(there[0]), _there(there[1]))
        return ChannelComparison(topic=topic, counts=(counts[0], counts[1]), first=missing, largest={}, units={})
    first: Difference | None
    if topic in PER_TICK and a.has_layout(topic) and b.has_layout(topic):
        rows_a, rows_b = _until(a.channel(topic), last_tick), _until(b.channel(topic), last_tick)
        first, largest = _compare_rows(topic, rows_a, rows_b)
        counts = (len(rows_a), len(rows_b))
    else:
        known = None if topic == EVENTS and min(a.format or 0, b.format or 0) >= SCUFF_SINCE else UNKNOWN_EVENTS
        records = [
            sorted(
                (
                    record
                    for record in log.records(topic)
                    if (last_tick is None or _tick(record) < last_tick) and not _is_apart(topic, record, known)
                ),
                key=lambda record: (time_ns(record), record[HEADER:]),
            )
            for log in (a, b)
        ]
        first, largest = _compare_records(topic, records[0], records[1]), {}
        counts = (len(records[0]), len(records[1]))
    units = {**b.units(topic), **a.units(topic)}
    if first is None and (a.units(topic) != b.units(topic) or _schema(a, topic) != _schema(b, topic)):
        first = Difference(0, topic, "", "its schema or units", "others")
    return ChannelComparison(topic=topic, counts=(counts[0], counts[1]), first=first, largest=largest, units=units)


def _schema(log: Log, topic: str) -> object:
    """What a channel's messages are made of, without names of enum codes: later versions have more of them."""
    try:
        return log.fields(topic)
    except UserError:
        schema = log.schemas.get(log.channels[topic].schema_id)
        return schema.data if schema else None


def _is_apart(topic: str, record: bytes, unknown: frozenset[str] | None) -> bool:
    """Whether a message is an event that is not compared.

    Those are the one that names scenario and versions, told apart elsewhere, and kinds an older format does not have.
    """
    if topic != EVENTS:
        return False
    try:
        name = Event.FromString(record[HEADER:]).name
    except Exception:  # not readable: compared as bytes
        return False
    return bool(name == "run" or name in (unknown or ()))


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


def _shown(topic: str, record: bytes) -> str:
    """A message in words: an event's own, for others their size."""
    if topic == EVENTS:
        with contextlib.suppress(Exception):
            return repr(printable(Event.FromString(record[HEADER:]).message, 80))
    return f"a message of {len(record) - HEADER} bytes"


def _compare_records(topic: str, a: Collection[bytes], b: Collection[bytes]) -> Difference | None:
    for x, y in zip(a, b, strict=False):
        if x[15:] != y[15:]:  # ids and numbers may differ
            return Difference(min(_tick(x), _tick(y)), topic, "", _shown(topic, x), _shown(topic, y))
    if len(a) != len(b):
        longer = list(a if len(a) > len(b) else b)
        tick = _tick(longer[min(len(a), len(b))])
        words = ("present", "missing") if len(a) > len(b) else ("missing", "present")
        return Difference(tick, topic, "", *words)
    return None

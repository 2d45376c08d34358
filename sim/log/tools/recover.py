"""Saves what is sound in a log whose run was killed or whose file is damaged, as a new log."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from sim.errors import UserError
from sim.log.format.topics import PER_TICK
from sim.log.read import Log
from sim.log.read.log import time_ns
from sim.log.read.reader import log_of, read_bytes
from sim.log.read.scan import Scan, scan
from sim.log.tools.text import printable
from sim.log.write.container import McapFile

CHUNK = 200_000  # [B] of messages in a chunk


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recovery:
    """What was saved.

    Attributes:
        log: What could be read.
        messages: Messages saved.
        last_s: Time of the last message in [s].
        lost: What is missing, one sentence each; empty if the log was whole.
    """

    log: Log
    messages: int
    last_s: float
    lost: tuple[str, ...]


def recover(source: Path, target: Path) -> Recovery:
    """Write a valid log with all that is sound in another.

    Args:
        source: A log, perhaps truncated or damaged.
        target: The new log; must not exist.

    Raises:
        UserError: the source is no MCAP file or holds no message, or the target exists or cannot be written.
    """
    data = read_bytes(source)
    walked = scan(data)
    log = log_of(source, walked)
    sound = {topic: _sound(log, topic) for topic in log.channels}
    records = [(record, topic) for topic, kept in sound.items() for record in kept]
    if not records:
        raise UserError(f"{source}: no message can be saved")
    lost = _lost(log, walked, len(data), sound)
    in_time = sorted(records, key=lambda one: time_ns(one[0]))
    file = McapFile(target)
    try:
        for opcode, record in walked.kept:
            if opcode == Opcode.METADATA and not (lost and record.name == "recovery"):
                file.metadata(record.name, record.metadata)
            elif opcode == Opcode.ATTACHMENT:
                file.attachment(record.name, record.media_type, record.data)
        if lost:
            before = log.metadata.get("recovery", {}).get("lost")
            losses = "; ".join([before, *lost] if before else lost)
            file.metadata("recovery", {"lost": losses, "source": printable(source.name)})
        ids = {topic: file.copy(channel, log.schemas.get(channel.schema_id)) for topic, channel in log.channels.items()}
        _write(file, in_time, ids)
    finally:
        file.finish()
    return Recovery(log=log, messages=len(records), last_s=time_ns(in_time[-1][0]) * 1e-9, lost=lost)


def _sound(log: Log, topic: str) -> list[bytes]:
    """Message records of a channel that match its schema; all of a foreign one, which nobody here can judge."""
    records = log.records(topic)
    if not log.is_own(topic):
        return records
    if log.has_layout(topic):
        rows = log.channel(topic)
        if not log.malformed[topic]:
            return records
        keys = set(zip(rows["_tick"].tolist(), rows["_time_ns"].tolist(), strict=True))
        size = rows.dtype.itemsize
        return [r for r in records if len(r) == size and (int.from_bytes(r[11:15], "little"), time_ns(r)) in keys]
    try:
        return [record for record, _ in log.decoded(topic)]
    except UserError:  # no schema that can be read: kept as it is
        return records


def _write(file: McapFile, records: list[tuple[bytes, str]], ids: dict[str, int]) -> None:
    """Write messages of topics in chunks, channel ids replaced: parts of one channel had ids of their own."""
    parts: list[bytes] = []
    index: dict[int, list[tuple[int, int]]] = {}
    size = 0

    def flush() -> None:
        nonlocal size
        if parts:
            entries: dict[int, NDArray[np.uint64]] = {k: np.array(v, np.uint64) for k, v in index.items()}
            file.chunk(b"".join(parts), entries)
        parts.clear()
        index.clear()
        size = 0

    for record, topic in records:
        channel_id = ids[topic]
        index.setdefault(channel_id, []).append((time_ns(record), size))
        parts.append(record[:9] + channel_id.to_bytes(2, "little") + record[11:])
        size += len(record)
        if size >= CHUNK:
            flush()
    flush()


def _lost(log: Log, walked: Scan, size: int, sound: dict[str, list[bytes]]) -> tuple[str, ...]:
    """What is missing or may be: damage of the summary, which only repeats the data, costs nothing."""
    lost = [f"at byte {at}: {text}" for at, text in walked.problems]
    known = {channel.id for channel in log.channels.values()}
    unknown = {channel_id for channel_id, records in log.unread.items() if records and channel_id not in known}
    if unknown:
        lost.append(f"messages of {len(unknown)} channels whose description is gone")
    for topic, records in sound.items():
        missing = len(log.records(topic)) - len(records)
        if missing:
            lost.append(f"{missing} messages of {topic} that do not match its schema")
    if not walked.ended and not walked.problems:
        lost.append(f"the file stops in the middle: {size - walked.end} of its {size} bytes belong to nothing whole")
    if "result" not in log.metadata:
        lost.append("the result of the run, which is written at its end")
    for topic, first, last in gaps(log):
        lost.append(f"ticks {first} to {last} of {topic}")
    return tuple(lost)


def gaps(log: Log) -> list[tuple[str, int, int]]:
    """Ticks missing in between: (topic, first, last) of each gap of each per-tick channel, 20 a channel at most."""
    lacking = []
    for topic in log.own:
        if topic not in PER_TICK or not log.has_layout(topic):
            continue
        ticks = np.unique(log.channel(topic)["_tick"].astype(np.int64))
        before = np.concatenate(((-1,), ticks))
        for i in np.flatnonzero(np.diff(before) > 1)[:20]:
            lacking.append((topic, int(before[i]) + 1, int(before[i + 1]) - 1))
    return lacking

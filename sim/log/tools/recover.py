"""Saves what is sound in a log whose run was killed or whose file is damaged, as a new log."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from sim.errors import UserError
from sim.log.format.fields import CHANNELS
from sim.log.read import Log
from sim.log.read.reader import log_of, read_bytes
from sim.log.read.scan import scan
from sim.log.write.container import McapFile

PER_TICK = frozenset(channel.topic for channel in CHANNELS)
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
    found = scan(data)
    log = log_of(source, found)
    known = {channel.id: channel for channel in log.channels.values()}
    for channel in known.values():
        schema = log.schemas.get(channel.schema_id)
        if channel.message_encoding != "protobuf" or schema is None or schema.encoding != "protobuf":
            raise UserError(f"{source}: channel {channel.topic} holds no protobuf messages: not a log of this program")
    records = [record for channel_id in known for record in found.messages.get(channel_id, ())]
    if not records:
        raise UserError(f"{source}: no message can be saved")
    lost = _lost(log, len(data), found.end, found.messages.keys() - known.keys())
    with_time = sorted(enumerate(records), key=lambda pair: (_time_ns(pair[1]), pair[0]))
    file = McapFile(target)
    try:
        for opcode, record in found.kept:
            if opcode == Opcode.METADATA:
                file.metadata(record.name, record.metadata)
            elif opcode == Opcode.ATTACHMENT:
                file.attachment(record.name, record.media_type, record.data)
        if lost:
            file.metadata("recovery", {"lost": "; ".join(lost), "source": source.name})
        ids = {
            old: file.channel(
                channel.topic,
                log.schemas[channel.schema_id].name,
                log.schemas[channel.schema_id].data,
                channel.metadata,
            )
            for old, channel in known.items()
        }
        _write(file, [record for _, record in with_time], ids)
    finally:
        file.finish()
    return Recovery(log=log, messages=len(records), last_s=_time_ns(with_time[-1][1]) * 1e-9, lost=lost)


def _time_ns(record: bytes) -> int:
    return int.from_bytes(record[15:23], "little")


def _write(file: McapFile, records: list[bytes], ids: dict[int, int]) -> None:
    """Write messages in chunks, channel ids replaced."""
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

    for record in records:
        channel_id = ids[int.from_bytes(record[9:11], "little")]
        index.setdefault(channel_id, []).append((_time_ns(record), size))
        parts.append(record[:9] + channel_id.to_bytes(2, "little") + record[11:])
        size += len(record)
        if size >= CHUNK:
            flush()
    flush()


def _lost(log: Log, size: int, end: int, unknown: set[int]) -> tuple[str, ...]:
    lost = [f"at byte {at}: {text}" for at, text in log.problems]
    if unknown:
        lost.append(f"messages of {len(unknown)} channels whose description is gone")
    if not log.complete and not log.problems:
        lost.append(f"the file stops in the middle: {size - end} of its {size} bytes belong to nothing whole")
    if "result" not in log.metadata:
        lost.append("the result of the run, which is written at its end")
    for topic, first, last in gaps(log):
        lost.append(f"ticks {first} to {last} of {topic}")
    return tuple(lost)


def gaps(log: Log) -> list[tuple[str, int, int]]:
    """Ticks missing in between: (topic, first, last) of each gap of each per-tick channel."""
    found = []
    for topic in log.channels:
        if topic not in PER_TICK or not log.has_layout(topic):
            continue
        ticks = log.channel(topic)["_tick"].astype(np.int64)
        before = np.concatenate(((-1,), ticks))
        for i in np.flatnonzero(np.diff(before) > 1)[:20]:
            found.append((topic, int(before[i]) + 1, int(before[i + 1]) - 1))
    return found

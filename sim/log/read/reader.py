"""Reads a log back from its file.

A log is data from outside: see `sim.log.read.scan` for what is checked before anything is believed. A file that
stops in the middle (a killed run) gives everything up to the cut.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from mcap.opcode import Opcode
from mcap.records import Channel
from mcap.writer import MCAP0_MAGIC
from numpy.typing import NDArray

from sim.errors import UserError
from sim.log.format.topics import OWN
from sim.log.read.log import Log, time_ns
from sim.log.read.scan import Problem, Scan, scan

LARGEST_FILE = 2**31  # [B]
MOST_TOPICS = 500


def read_log(path: Path | str) -> Log:
    """Read a log, finished or not.

    Args:
        path: The MCAP file.

    Raises:
        UserError: it cannot be opened, is no MCAP file, is damaged, or of a format this program does not know.
    """
    log = salvage(path)
    log.tolerant = False
    if log.unknown_format:
        raise UserError(f"{log.path} {log.unknown_format}")
    if log.problems:
        first = log.problems[0]
        raise UserError(f"{log.path} is damaged at byte {first.at}: {first.text}; cmpc log recover saves the rest")
    return log


def salvage(path: Path | str) -> Log:
    """Read what is sound in a log; what is not is listed in `problems`.

    Args:
        path: The MCAP file.

    Raises:
        UserError: it cannot be opened or is no MCAP file.
    """
    path = Path(path)
    return log_of(path, scan(read_bytes(path)))


def read_bytes(path: Path) -> bytes:
    """All bytes of an MCAP file.

    Raises:
        UserError: it cannot be opened, is larger than `LARGEST_FILE`, or is no MCAP file.
    """
    try:
        if path.exists() and not path.is_file():
            raise UserError(f"cannot read log {path}: it is not a file")
        if path.stat().st_size > LARGEST_FILE:
            raise UserError(f"log {path} has {path.stat().st_size} bytes; at most {LARGEST_FILE} are read")
        data = path.read_bytes()
    except OSError as error:
        raise UserError(f"cannot read log {path}: {error.strerror}") from error
    if not data.startswith(MCAP0_MAGIC):
        raise UserError(f"{path} is not an MCAP file")
    return data


def log_of(path: Path, walked: Scan) -> Log:
    """A log from what a walk through its file found."""
    problems = walked.problems + walked.summary_problems
    log = Log(
        path,
        complete=walked.complete,
        ended=walked.ended,
        tolerant=True,
        chunks=tuple(walked.chunks),
        compressions=tuple(sorted(walked.compressions)),
    )
    channels = []
    for opcode, record in walked.kept:
        if opcode == Opcode.SCHEMA:
            log.schemas[record.id] = record
        elif opcode == Opcode.CHANNEL:
            channels.append(record)
        elif opcode == Opcode.METADATA:
            if record.name in log.metadata:
                problems.append(Problem(0, f"metadata {record.name[:40]!r} is there twice"))
            log.metadata.setdefault(record.name, record.metadata)
        elif opcode == Opcode.ATTACHMENT:
            if record.name in log.attachments:
                problems.append(Problem(0, f"attachment {record.name[:40]!r} is there twice"))
            log.attachments.setdefault(record.name, (record.media_type, record.data))
    log._records = _in_time(walked.messages)
    log._order = _name_topics(log, channels, walked.order)
    log.problems = tuple(problems)
    return log


def _name_topics(log: Log, channels: Sequence[Channel], order: Sequence[int]) -> Sequence[int]:
    """Give every channel a topic of its own; ours first, and as one where a file has it in parts.

    Returns:
        Channel id of each message in order of the file, parts of one channel under one id.
    """

    def name(channel: Channel) -> str:
        schema = log.schemas.get(channel.schema_id)
        return schema.name if schema is not None and schema.encoding == "protobuf" else ""

    joined: dict[int, int] = {}
    for channel in sorted(channels, key=lambda c: OWN.get(c.topic) != name(c)):
        first = log.channels.get(channel.topic)
        if first is None and len(log.channels) < MOST_TOPICS:
            log.channels[channel.topic] = channel
        elif first is not None and log.schemas.get(first.schema_id) == log.schemas.get(channel.schema_id):
            joined[channel.id] = first.id
        elif len(log.channels) < MOST_TOPICS:
            log.channels[f"{channel.topic} ({channel.id})"] = channel
    if not joined:
        return order
    for part, whole in joined.items():
        log._records[whole] = log._records.get(whole, []) + log._records.pop(part, [])
    log._records = _in_time(log._records)
    return [joined.get(one, one) for one in order]


def _in_time(messages: Mapping[int, list[bytes]]) -> dict[int, list[bytes]]:
    """Messages of each channel in order of time, those of one time as they come."""
    ordered = {}
    for channel_id, records in messages.items():
        times = [time_ns(record) for record in records]
        ordered[channel_id] = records if times == sorted(times) else sorted(records, key=time_ns)
    return ordered


def read_channel(path: Path | str, topic: str) -> NDArray[Any]:
    """Every message of one per-tick channel of a log; see `Log.channel`."""
    return read_log(path).channel(topic)

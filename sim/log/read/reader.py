"""Reads a log back: tick channels as structured arrays, the rest as protobuf messages.

A log is data from outside: see `sim.log.read.scan` for what is checked before anything is believed. A file that
stops in the middle (a killed run) gives everything up to the cut.
"""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from google.protobuf import descriptor_pool, message_factory
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from mcap.writer import MCAP0_MAGIC
from numpy.typing import NDArray

from sim.errors import UserError
from sim.log.format.layout import HEADER, layout_of
from sim.log.read.scan import Problem, Scan, scan

LARGEST_FILE = 2**31  # [B]


@dataclass(slots=True, eq=False)
class Log:
    """A log in memory.

    Attributes:
        path: Where it was read from.
        complete: Whether it was finished; False for a truncated file.
        problems: What is damaged in it; empty for one that just stops.
        chunks: Sound chunks.
        metadata: Name of a metadata record -> its entries ("run", "result").
        attachments: File name -> (media type, content).
        channels: Topic -> channel record.
        schemas: Schema id -> schema record.
    """

    path: Path
    complete: bool = False
    problems: tuple[Problem, ...] = ()
    chunks: int = 0
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: dict[str, tuple[str, bytes]] = field(default_factory=dict)
    channels: dict[str, Channel] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    _records: dict[int, list[bytes]] = field(default_factory=dict, repr=False)

    def channel(self, topic: str) -> NDArray[Any]:
        """Every message of a per-tick channel as one structured array.

        Fields are `_tick`, `_time_ns`, `_publish_ns`, then the dotted field names of the schema in the file.

        Args:
            topic: Such as "/control".

        Raises:
            UserError: no such channel, or its messages have no fixed layout.
        """
        kind, records = self._message_type(topic), self.records(topic)
        try:
            layout = layout_of(kind.DESCRIPTOR)
        except ValueError as error:
            raise UserError(f"{self.path}: {topic} is not a per-tick channel: {error}") from None
        dtype = layout.record_dtype
        if any(len(record) != dtype.itemsize for record in records):
            raise UserError(f"{self.path}: a message of {topic} has not the {dtype.itemsize} bytes it should")
        data = b"".join(records)
        if not layout.fits(np.frombuffer(data, np.uint8).reshape(-1, dtype.itemsize)):
            raise UserError(f"{self.path}: a message of {topic} does not match its schema")
        return np.frombuffer(data, dtype)

    def messages(self, topic: str) -> list[tuple[int, Any]]:
        """Every message of a channel, decoded by protobuf: (log time in [ns], message)."""
        kind = self._message_type(topic)
        try:
            return [
                (int.from_bytes(record[15:23], "little"), kind.FromString(record[HEADER:]))
                for record in self.records(topic)
            ]
        except Exception as error:
            raise UserError(f"{self.path}: a message of {topic} cannot be decoded: {error}") from error

    def records(self, topic: str) -> list[bytes]:
        """Every message record of a channel as bytes: `HEADER` bytes, then the message."""
        return self._records.get(self._channel(topic).id, [])

    def has_layout(self, topic: str) -> bool:
        """Whether the channel's messages have a fixed layout, so that `channel` can read them."""
        try:
            layout_of(self._message_type(topic).DESCRIPTOR)
        except ValueError:  # a UserError is one
            return False
        return True

    def units(self, topic: str) -> dict[str, str]:
        """Unit of each field of a channel of our own, by dotted name."""
        return self._texts(topic, "units")

    def descriptions(self, topic: str) -> dict[str, str]:
        """Meaning of each field of a channel of our own, by dotted name."""
        return self._texts(topic, "descriptions")

    def _texts(self, topic: str, key: str) -> dict[str, str]:
        try:
            found = json.loads(self._channel(topic).metadata.get(key, "{}"))
        except (ValueError, RecursionError):
            found = None
        if not isinstance(found, dict):
            raise UserError(f"{self.path}: {key} of {topic} are no JSON object")
        return {str(name): str(text) for name, text in found.items()}

    def enums(self, topic: str) -> dict[str, dict[int, str]]:
        """Dotted name of each enum field of a channel -> names of its codes."""
        found: dict[str, dict[int, str]] = {}
        for entry in self._message_type(topic).DESCRIPTOR.fields:
            if entry.enum_type is not None:
                found[entry.name] = {value.number: value.name for value in entry.enum_type.values}
        return found

    def _channel(self, topic: str) -> Channel:
        if topic not in self.channels:
            raise UserError(f"{self.path} has no channel {topic}; it has {sorted(self.channels)}")
        return self.channels[topic]

    def _message_type(self, topic: str) -> Any:
        schema = self.schemas.get(self._channel(topic).schema_id)
        try:
            if schema is None:
                raise ValueError("schema is missing")
            pool = descriptor_pool.DescriptorPool()
            for file in FileDescriptorSet.FromString(schema.data).file:
                pool.Add(file)
            return message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))
        except Exception as error:
            raise UserError(f"{self.path}: schema of {topic} cannot be read: {error}") from error


def read_log(path: Path | str) -> Log:
    """Read a log, finished or not.

    Args:
        path: The MCAP file.

    Raises:
        UserError: it cannot be opened, is no MCAP file, or is damaged.
    """
    log = salvage(path)
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


def log_of(path: Path, found: Scan) -> Log:
    """A log from what a scan found."""
    log = Log(path, complete=found.complete, problems=tuple(found.problems), chunks=found.chunks)
    log._records = found.messages
    for opcode, record in found.kept:
        if opcode == Opcode.SCHEMA:
            log.schemas[record.id] = record
        elif opcode == Opcode.CHANNEL:
            log.channels[record.topic] = record
        elif opcode == Opcode.METADATA:
            log.metadata[record.name] = record.metadata
        elif opcode == Opcode.ATTACHMENT:
            log.attachments[record.name] = (record.media_type, record.data)
    return log


def read_channel(path: Path | str, topic: str) -> NDArray[Any]:
    """Every message of one per-tick channel of a log; see `Log.channel`."""
    return read_log(path).channel(topic)

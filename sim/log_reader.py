"""Reads a log back: tick channels as structured arrays, the rest as protobuf messages.

A log is data from outside: a record is only looked at when it is there in full, and a chunk is only unpacked
up to a bounded size. A file that stops in the middle (a killed run) gives everything up to the cut.
"""

import json
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import zstandard
from google.protobuf import descriptor_pool, message_factory
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Metadata, Schema
from mcap.writer import MCAP0_MAGIC
from numpy.typing import NDArray

from sim.errors import UserError
from sim.recorder.layout import HEADER, layout_of

LARGEST_CHUNK = 64 * 2**20  # [B] unpacked; ours are 0.2 MB
_RECORD = struct.Struct("<BQ")


@dataclass(slots=True, eq=False)
class Log:
    """A log in memory.

    Attributes:
        path: Where it was read from.
        complete: Whether it was finished; False for a truncated file.
        metadata: Name of a metadata record -> its entries ("run", "result").
        attachments: File name -> (media type, content).
        channels: Topic -> channel record.
        schemas: Schema id -> schema record.
    """

    path: Path
    complete: bool = False
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: dict[str, tuple[str, bytes]] = field(default_factory=dict)
    channels: dict[str, Channel] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    _records: dict[int, list[bytes]] = field(default_factory=dict)

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
        data = b"".join(records)
        if any(len(record) != dtype.itemsize for record in records):
            raise UserError(f"{self.path}: a message of {topic} has not the {dtype.itemsize} bytes it should")
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

    def units(self, topic: str) -> dict[str, str]:
        """Unit of each field of a per-tick channel, by dotted name."""
        return dict(json.loads(self._channel(topic).metadata.get("units", "{}")))

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
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UserError(f"cannot read log {path}: {error.strerror}") from error
    if not data.startswith(MCAP0_MAGIC):
        raise UserError(f"{path} is not an MCAP file")
    log = Log(path)
    for at, opcode, body in _records(memoryview(data), len(MCAP0_MAGIC)):
        if opcode == Opcode.FOOTER:
            log.complete = data.endswith(MCAP0_MAGIC)
            break
        try:
            _take(log, opcode, body)
        except Exception as error:
            raise UserError(f"{path} is damaged at byte {at}: {error}") from error
    return log


def read_channel(path: Path | str, topic: str) -> NDArray[Any]:
    """Every message of one per-tick channel of a log; see `Log.channel`."""
    return read_log(path).channel(topic)


def _records(data: memoryview, at: int) -> Iterator[tuple[int, int, memoryview]]:
    """Whole records from a byte on: (offset, opcode, body)."""
    while at + _RECORD.size <= len(data):
        opcode, length = _RECORD.unpack_from(data, at)
        end = at + _RECORD.size + length
        if end > len(data):
            return
        yield at, opcode, data[at + _RECORD.size : end]
        at = end


def _take(log: Log, opcode: int, body: memoryview) -> None:
    """Keep what one record says."""
    if opcode == Opcode.CHUNK:
        _unpack(log, Chunk.read(_stream(body)))
    elif opcode == Opcode.SCHEMA:
        schema = Schema.read(_stream(body))
        log.schemas[schema.id] = schema
    elif opcode == Opcode.CHANNEL:
        channel = Channel.read(_stream(body))
        log.channels[channel.topic] = channel
    elif opcode == Opcode.METADATA:
        metadata = Metadata.read(_stream(body))
        log.metadata[metadata.name] = metadata.metadata
    elif opcode == Opcode.ATTACHMENT:
        if zlib.crc32(body[:-4]) != int.from_bytes(body[-4:], "little"):
            raise ValueError("CRC of an attachment is wrong")
        attachment = Attachment.read(_stream(body))
        log.attachments[attachment.name] = (attachment.media_type, attachment.data)


def _unpack(log: Log, chunk: Chunk) -> None:
    """Sort the message records of a chunk by channel."""
    if chunk.compression != "zstd":
        raise ValueError(f'compression "{chunk.compression}" is not "zstd"')
    if chunk.uncompressed_size > LARGEST_CHUNK:
        raise ValueError(f"a chunk of {chunk.uncompressed_size} bytes exceeds the limit of {LARGEST_CHUNK}")
    declared = zstandard.frame_content_size(chunk.data)
    if declared not in (-1, chunk.uncompressed_size):
        raise ValueError(f"a chunk holds {declared} bytes and says {chunk.uncompressed_size}")
    data = zstandard.ZstdDecompressor().decompress(chunk.data, max_output_size=chunk.uncompressed_size)
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise ValueError("CRC of a chunk is wrong")
    view = memoryview(data)
    for at, opcode, body in _records(view, 0):
        if opcode == Opcode.MESSAGE:
            channel_id = int.from_bytes(body[:2], "little")
            log._records.setdefault(channel_id, []).append(data[at : at + _RECORD.size + len(body)])
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            _take(log, opcode, body)


def _stream(body: memoryview) -> ReadDataStream:
    return ReadDataStream(BytesIO(body))

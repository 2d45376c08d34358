"""Reads a log of ours while it is being written, chunk by chunk."""

import io
import struct
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Schema

_MAGIC = 8  # [B]
_HEAD = struct.Struct("<BQ")  # opcode and length of a record
_POLL = 0.02  # [s] between two looks at the file


class Piece(NamedTuple):
    """What a chunk brings.

    Attributes:
        channels: Channel and schema by the channel's id, all that are known.
        messages: Channel id and message record as bytes, in the file's order.
    """

    channels: Mapping[int, tuple[Channel, Schema]]
    messages: list[tuple[int, bytes]]


def follow(path: Path, ended: Callable[[], bool]) -> Iterator[Piece]:
    """Chunks of a log as they are written, to its end.

    Args:
        path: The file; it may not be there yet.
        ended: Whether nobody writes any more; then what is there is read, finished or not.
    """
    schemas: dict[int, Schema] = {}
    channels: dict[int, tuple[Channel, Schema]] = {}
    for opcode, data in _records(path, ended):
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(ReadDataStream(io.BytesIO(data)))
            schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(ReadDataStream(io.BytesIO(data)))
            if channel.schema_id in schemas:
                channels[channel.id] = channel, schemas[channel.schema_id]
        elif opcode == Opcode.CHUNK:
            chunk = Chunk.read(ReadDataStream(io.BytesIO(data)))
            body = zstandard.decompress(chunk.data, chunk.uncompressed_size) if chunk.compression else chunk.data
            yield Piece(channels, list(_messages(body)))


def _records(path: Path, ended: Callable[[], bool]) -> Iterator[tuple[int, bytes]]:
    """Records of a growing file; the footer is the last."""
    while not path.exists():
        if ended():
            return
        time.sleep(_POLL)
    with path.open("rb") as file:
        buffer, skip = b"", _MAGIC
        while True:
            last = ended()  # asked before reading: what was written before is read
            new = file.read()
            buffer += new
            at = skip
            while len(buffer) - at >= _HEAD.size:
                opcode, length = _HEAD.unpack_from(buffer, at)
                end = at + _HEAD.size + length
                if end > len(buffer):
                    break
                if opcode == Opcode.FOOTER:
                    return
                yield opcode, buffer[at + _HEAD.size : end]
                at = end
            buffer, skip = (buffer[at:], 0) if at <= len(buffer) else (buffer, skip)
            if not new:
                if last:
                    return
                time.sleep(_POLL)


def _messages(body: bytes) -> Iterator[tuple[int, bytes]]:
    at = 0
    while len(body) - at >= _HEAD.size:
        opcode, length = _HEAD.unpack_from(body, at)
        end = at + _HEAD.size + length
        if opcode == Opcode.MESSAGE:
            record = body[at:end]
            yield int.from_bytes(record[9:11], "little"), record
        at = end

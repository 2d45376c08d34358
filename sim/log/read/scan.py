"""Walks the records of an MCAP file that may be damaged, cut off or hostile.

Every record is checked against its own lengths and CRCs before anything is kept; nothing is allocated that the
file only claims to need. Where the bytes make no sense, the walk goes on at the next chunk it can recognise.
"""

import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from struct import Struct
from typing import Any, NamedTuple

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, DataEnd, Footer, Header, Metadata, Schema
from mcap.writer import MCAP0_MAGIC

LARGEST_CHUNK = 64 * 2**20  # [B] unpacked; ours are 0.3 MB
LARGEST_TOTAL = 2 * 2**30  # [B] unpacked, all chunks; a minute of walking is 70 MB
MOST_PROBLEMS = 100
"""Problems listed; there may be more."""

_RECORD = Struct("<BQ")
_MESSAGE_INDEX = Struct("<HI")
_ZSTD = b"\x04\x00\x00\x00zstd"
_ZSTD_AT = _RECORD.size + 8 + 8 + 8 + 4  # offset of the compression's name within a chunk record
_KINDS: dict[int, Any] = {
    Opcode.HEADER: Header,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.CHUNK: Chunk,
    Opcode.ATTACHMENT: Attachment,
    Opcode.METADATA: Metadata,
    Opcode.DATA_END: DataEnd,
}


class Problem(NamedTuple):
    """Something wrong with a file: at which byte, and what."""

    at: int
    text: str


@dataclass(slots=True, eq=False)
class Scan:
    """What a walk found.

    Attributes:
        complete: Whether the file was finished: it has a footer and ends as it should.
        end: Byte after the last whole record of the data.
        problems: What is wrong with it, at most `MOST_PROBLEMS`; a file that just stops has none.
        chunks: Chunks whose CRC is right.
        kept: (opcode, record) of every sound schema, channel, metadata and attachment, in order.
        messages: Channel id -> message records as bytes, in order.
    """

    complete: bool = False
    end: int = len(MCAP0_MAGIC)
    problems: list[Problem] = field(default_factory=list)
    chunks: int = 0
    kept: list[tuple[int, Any]] = field(default_factory=list)
    messages: dict[int, list[bytes]] = field(default_factory=dict)
    _unpacked: int = 0

    def problem(self, at: int, text: str) -> None:
        """Note a problem at a byte."""
        if len(self.problems) < MOST_PROBLEMS:
            self.problems.append(Problem(at, text))


class _Senseless(ValueError):
    """A record whose lengths contradict each other: the next one may be anywhere."""


def scan(data: bytes) -> Scan:
    """Walk a file that begins with MCAP's magic bytes."""
    found = Scan()
    view = memoryview(data)
    at = len(MCAP0_MAGIC)
    while at + _RECORD.size <= len(data):
        opcode, length = _RECORD.unpack_from(data, at)
        end = at + _RECORD.size + length
        if opcode == Opcode.DATA_END and end <= len(data):
            found.end = end
            _finish(found, data, at, end)
            return found
        try:
            if end > len(data):
                raise _Senseless("a record goes beyond the end of the file")
            _take(found, opcode, view[at + _RECORD.size : end])
        except _Senseless as error:
            again = _next_chunk(data, at)
            if again < 0:
                if end <= len(data):
                    found.problem(at, str(error))
                return found  # what follows is the record that was being written
            found.problem(at, f"{error}; skipped {again - at} bytes to the next chunk")
            at = again
            continue
        except Exception as error:
            found.problem(at, str(error) or type(error).__name__)
        at = found.end = end
    return found


def walk(data: memoryview, at: int) -> Iterator[tuple[int, int, memoryview]]:
    """Whole records from a byte on: (offset, opcode, body)."""
    while at + _RECORD.size <= len(data):
        opcode, length = _RECORD.unpack_from(data, at)
        end = at + _RECORD.size + length
        if end > len(data):
            return
        yield at, opcode, data[at + _RECORD.size : end]
        at = end


def parse(kind: Any, body: memoryview) -> Any:
    """One record of a kind of `mcap.records`; its fields must fill the body exactly.

    Raises:
        ValueError: they do not.
    """
    stream = BytesIO(body)
    try:
        record = kind.read(ReadDataStream(stream))
    except Exception as error:
        raise _Senseless(f"a {kind.__name__} record cannot be read: {str(error) or type(error).__name__}") from None
    if stream.tell() != len(body):
        raise _Senseless(f"a {kind.__name__} record has another length than its fields")
    return record


def _next_chunk(data: bytes, at: int) -> int:
    """Byte at which the next chunk record after `at` seems to begin, -1 if there is none."""
    while (name := data.find(_ZSTD, at + 1 + _ZSTD_AT)) >= 0:
        start = name - _ZSTD_AT
        opcode, length = _RECORD.unpack_from(data, start)
        if opcode == Opcode.CHUNK and start + _RECORD.size + length <= len(data):
            return start
        at = start
    return -1


def _take(found: Scan, opcode: int, body: memoryview) -> None:
    """Keep what one record of the data says, if it is sound."""
    if opcode == Opcode.MESSAGE_INDEX:
        if len(body) < _MESSAGE_INDEX.size or _MESSAGE_INDEX.unpack_from(body)[1] != len(body) - _MESSAGE_INDEX.size:
            raise _Senseless("a message index has another length than its entries")
        return
    if opcode not in _KINDS:
        raise _Senseless(f"there is no record of kind {opcode}")
    record = parse(_KINDS[opcode], body)
    if opcode == Opcode.CHUNK:
        _unpack(found, record)
        return
    if opcode == Opcode.ATTACHMENT and zlib.crc32(body[:-4]) != int.from_bytes(body[-4:], "little"):
        raise ValueError("CRC of an attachment is wrong")
    if opcode != Opcode.HEADER:
        found.kept.append((opcode, record))


def _unpack(found: Scan, chunk: Chunk) -> None:
    """Sort the message records of a chunk by channel."""
    if chunk.compression != "zstd":
        raise ValueError(f"compression {chunk.compression!r} of a chunk is not 'zstd'")
    if chunk.uncompressed_size > LARGEST_CHUNK:
        raise ValueError(f"a chunk of {chunk.uncompressed_size} bytes exceeds the limit of {LARGEST_CHUNK}")
    found._unpacked += chunk.uncompressed_size
    if found._unpacked > LARGEST_TOTAL:
        raise ValueError(f"the chunks exceed {LARGEST_TOTAL} bytes together")
    declared = zstandard.frame_content_size(chunk.data)
    if declared not in (-1, chunk.uncompressed_size):
        raise ValueError(f"a chunk holds {declared} bytes and says {chunk.uncompressed_size}")
    data = zstandard.ZstdDecompressor().decompress(chunk.data, max_output_size=chunk.uncompressed_size)
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise ValueError("CRC of a chunk is wrong")
    found.chunks += 1
    messages, size = found.messages, len(data)
    at, head, unpack = 0, _RECORD.size, _RECORD.unpack_from
    while at + head + 2 <= size:
        opcode, length = unpack(data, at)
        end = at + head + length
        if end > size:
            break
        if opcode == Opcode.MESSAGE:
            messages.setdefault(data[at + 9] | data[at + 10] << 8, []).append(data[at:end])
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            found.kept.append((opcode, parse(_KINDS[opcode], memoryview(data)[at + head : end])))
        at = end
    if at != size:
        raise ValueError("the records of a chunk do not fill it")


def _finish(found: Scan, data: bytes, at: int, end: int) -> None:
    """Check what closes a file, from the record at byte `at` that ends the data."""
    try:
        crc = parse(DataEnd, memoryview(data)[at + _RECORD.size : end]).data_section_crc
    except ValueError as error:
        found.problem(at, str(error))
        return
    if crc and zlib.crc32(data[:at]) != crc:
        found.problem(at, "CRC of the data section is wrong")
    for start, opcode, body in walk(memoryview(data), end):
        if opcode != Opcode.FOOTER:
            continue
        after = start + _RECORD.size + len(body)
        try:
            footer = parse(Footer, body)
        except ValueError as error:
            found.problem(start, str(error))
            return
        found.complete = data[after:] == MCAP0_MAGIC
        if not found.complete and len(data) > after:
            found.problem(after, "the file does not end as it should")
        if footer.summary_start and footer.summary_start != end:
            found.problem(start, "the footer points to a summary that is not there")
        elif footer.summary_crc and zlib.crc32(data[footer.summary_start : after - 4]) != footer.summary_crc:
            found.problem(start, "CRC of the summary is wrong")
        return
    if data.endswith(MCAP0_MAGIC):
        found.problem(end, "the summary cannot be read")

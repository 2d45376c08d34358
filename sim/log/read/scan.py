"""Walks the records of an MCAP file that may be damaged, cut off or hostile.

The walk is ours: `mcap.reader` stops at the first damage, trusts lengths and counts, and reads nothing of a file
that was cut off. Its record classes are used. Every record is checked against its own lengths and CRCs before
anything is kept; nothing is allocated that the file only claims to need. Where the bytes make no sense, the walk
goes on at the next record it can recognise.
"""

import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from struct import Struct
from typing import Any, NamedTuple

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, DataEnd, Footer, Header, Metadata, Schema
from mcap.writer import MCAP0_MAGIC

from sim.log.read.unpack import Budget, unpack

MOST_PROBLEMS = 100
"""Problems listed; a file with more places at which its records make no sense is read no further."""
MOST_DESCRIPTIONS = 5000  # schemas, channels, metadata and attachments; ours has 20
PRIVATE = 0x80  # opcodes from here on are anybody's own

_RECORD = Struct("<BQ")
_MESSAGE_INDEX = Struct("<HI")
_WINDOW = 2**20  # [B] searched at once
_CHAIN = 4  # records in a row that make sense
_KINDS: dict[int, Any] = {
    Opcode.HEADER: Header,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.CHUNK: Chunk,
    Opcode.ATTACHMENT: Attachment,
    Opcode.METADATA: Metadata,
    Opcode.DATA_END: DataEnd,
}
_IN_DATA = (*_KINDS, Opcode.MESSAGE, Opcode.MESSAGE_INDEX)
_LEAST_MESSAGE = 22  # [B]: channel, sequence, two times


class Problem(NamedTuple):
    """Something wrong with a file: at which byte, and what."""

    at: int
    text: str


@dataclass(slots=True, eq=False)
class Scan:
    """What a walk found.

    Attributes:
        complete: Whether the file was finished: it has a footer and ends as it should.
        ended: Whether the data section came to its end; what may be missing or wrong after it costs no message.
        end: Byte after the last whole record of the data.
        problems: What is wrong with the data, at most `MOST_PROBLEMS`; a file that just stops has none.
        summary_problems: What is wrong with the summary, which only repeats what the data say.
        chunks: Bytes in each chunk whose CRC is right, unpacked.
        compressions: Names of the compressions of chunks; "unchunked" where a message lies outside any.
        kept: (opcode, record) of every sound schema, channel, metadata and attachment, in order, each once.
        messages: Channel id -> message records as bytes, in order.
        order: Channel id of every message, in order of the file.
    """

    complete: bool = False
    ended: bool = False
    end: int = len(MCAP0_MAGIC)
    problems: list[Problem] = field(default_factory=list)
    summary_problems: list[Problem] = field(default_factory=list)
    chunks: list[int] = field(default_factory=list)
    compressions: set[str] = field(default_factory=set)
    kept: list[tuple[int, Any]] = field(default_factory=list)
    messages: dict[int, list[bytes]] = field(default_factory=dict)
    order: list[int] = field(default_factory=list)
    _defined: dict[tuple[int, int], Any] = field(default_factory=dict)

    def problem(self, at: int, text: str) -> None:
        """Note a problem at a byte."""
        if len(self.problems) < MOST_PROBLEMS:
            self.problems.append(Problem(at, text))

    def keep(self, opcode: int, record: Any) -> None:
        """Keep a record that describes the log.

        Raises:
            ValueError: another one has its id, or there are too many.
        """
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            known = self._defined.setdefault((opcode, record.id), record)
            if known is not record:
                if known != record:
                    raise ValueError(f"a second {Opcode(opcode).name.lower()} has the id {record.id}")
                return
        if len(self.kept) >= MOST_DESCRIPTIONS:
            raise ValueError(f"there are more than {MOST_DESCRIPTIONS} schemas, channels, metadata and attachments")
        self.kept.append((opcode, record))

    def take_message(self, record: bytes, budget: Budget) -> None:
        """Keep a message record.

        Raises:
            ValueError: it is too short, or there are too many.
        """
        if len(record) < _RECORD.size + _LEAST_MESSAGE:
            raise ValueError("a message is shorter than its head")
        budget.take_message()
        channel_id = record[9] | record[10] << 8
        self.messages.setdefault(channel_id, []).append(record)
        self.order.append(channel_id)


class _Senseless(ValueError):
    """A record whose lengths contradict each other: the next one may be anywhere."""


def scan(data: bytes) -> Scan:
    """Walk a file that begins with MCAP's magic bytes."""
    walked, budget = Scan(), Budget(len(data))
    view = memoryview(data)
    at = len(MCAP0_MAGIC)
    while at + _RECORD.size <= len(data):
        opcode, length = _RECORD.unpack_from(data, at)
        end = at + _RECORD.size + length
        if opcode == Opcode.DATA_END and end <= len(data):
            walked.end = end
            _finish(walked, data, at, end)
            return walked
        try:
            if end > len(data):
                raise _Senseless("a record goes beyond the end of the file")
            _take(walked, opcode, view[at:end], budget)
        except _Senseless as error:
            again = _resume(data, at) if len(walked.problems) < MOST_PROBLEMS else -1
            if again < 0:
                if end <= len(data):
                    walked.problem(at, str(error))
                return walked  # what follows is the record that was being written
            walked.problem(at, f"{error}; skipped {again - at} bytes to the next record")
            at = again
            continue
        except Exception as error:
            walked.problem(at, str(error) or type(error).__name__)
        at = walked.end = end
    return walked


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


def _resume(data: bytes, at: int) -> int:
    """Byte after `at` at which records make sense again, -1 if there is none."""
    array = np.frombuffer(data, np.uint8)
    known = np.zeros(256, bool)
    known[list(_IN_DATA)] = True
    tries = 100_000
    for start in range(at + 1, len(data) - _RECORD.size, _WINDOW):
        part = array[start : start + _WINDOW + _RECORD.size - 1]
        n = len(part) - _RECORD.size + 1
        likely = known[part[:n]]
        for place in range(5, 9):  # no record of 4 GiB or more
            likely &= part[place : place + n] == 0
        for candidate in np.flatnonzero(likely).tolist():
            tries -= 1
            if tries < 0:
                return -1
            if _makes_sense(data, start + candidate):
                return int(start + candidate)
    return -1


def _makes_sense(data: bytes, at: int) -> bool:
    """Whether records begin at a byte: several in a row of possible lengths, or one whole chunk."""
    view = memoryview(data)
    for _ in range(_CHAIN):
        if at + _RECORD.size > len(data):
            return False
        opcode, length = _RECORD.unpack_from(data, at)
        end = at + _RECORD.size + length
        if end > len(data) or opcode not in _IN_DATA:
            return False
        body = view[at + _RECORD.size : end]
        try:
            if opcode == Opcode.MESSAGE_INDEX:
                _check_index(body)
            elif opcode == Opcode.MESSAGE:
                if length < _LEAST_MESSAGE:
                    return False
            else:
                parse(_KINDS[opcode], body)
        except ValueError:
            return False
        if opcode in (Opcode.CHUNK, Opcode.DATA_END):
            return True
        at = end
    return True


def _check_index(body: memoryview) -> None:
    if len(body) < _MESSAGE_INDEX.size or _MESSAGE_INDEX.unpack_from(body)[1] != len(body) - _MESSAGE_INDEX.size:
        raise _Senseless("a message index has another length than its entries")


def _take(walked: Scan, opcode: int, whole: memoryview, budget: Budget) -> None:
    """Keep what one record of the data says, if it is sound."""
    body = whole[_RECORD.size :]
    if opcode == Opcode.MESSAGE_INDEX:
        _check_index(body)
        return
    if opcode == Opcode.MESSAGE:
        walked.take_message(bytes(whole), budget)
        walked.compressions.add("unchunked")
        return
    if opcode >= PRIVATE:
        return
    if opcode not in _KINDS:
        raise _Senseless(f"there is no record of kind {opcode} in the data")
    record = parse(_KINDS[opcode], body)
    if opcode == Opcode.CHUNK:
        _take_chunk(walked, record, budget)
        return
    if opcode == Opcode.ATTACHMENT:
        crc = int.from_bytes(body[-4:], "little")
        if crc and zlib.crc32(body[:-4]) != crc:
            raise ValueError("CRC of an attachment is wrong")
    if opcode != Opcode.HEADER:
        walked.keep(opcode, record)


def _take_chunk(walked: Scan, chunk: Chunk, budget: Budget) -> None:
    """Sort the message records of a chunk by channel."""
    data = unpack(chunk, budget)
    walked.compressions.add(chunk.compression or "none")
    size = len(data)
    walked.chunks.append(size)
    at, head, read = 0, _RECORD.size, _RECORD.unpack_from
    while at + head <= size:
        opcode, length = read(data, at)
        end = at + head + length
        if end > size:
            break
        if opcode == Opcode.MESSAGE:
            walked.take_message(data[at:end], budget)
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            try:
                walked.keep(opcode, parse(_KINDS[opcode], memoryview(data)[at + head : end]))
            except _Senseless as error:  # the chunk's own lengths are right: only this record is lost
                raise ValueError(str(error)) from None
        at = end
    if at != size:
        raise ValueError("the records of a chunk do not fill it")


def _finish(walked: Scan, data: bytes, at: int, end: int) -> None:
    """Check what closes a file, from the record at byte `at` that ends the data."""
    try:
        crc = parse(DataEnd, memoryview(data)[at + _RECORD.size : end]).data_section_crc
    except ValueError as error:
        walked.problem(at, str(error))
        return
    walked.ended = True
    if crc and zlib.crc32(data[:at]) != crc:
        walked.problem(at, "CRC of the data section is wrong")
    wrong = walked.summary_problems
    for start, opcode, body in walk(memoryview(data), end):
        if opcode != Opcode.FOOTER:
            continue
        after = start + _RECORD.size + len(body)
        try:
            footer = parse(Footer, body)
        except ValueError as error:
            wrong.append(Problem(start, str(error)))
            return
        walked.complete = data[after:] == MCAP0_MAGIC
        if not walked.complete and not MCAP0_MAGIC.startswith(data[after:]):
            wrong.append(Problem(after, "the file does not end as it should"))
        if footer.summary_start and footer.summary_start != end:
            wrong.append(Problem(start, "the footer points to a summary that is not there"))
        elif footer.summary_crc and zlib.crc32(data[end : after - 4]) != footer.summary_crc:
            wrong.append(Problem(start, "CRC of the summary is wrong"))
        return
    if data.endswith(MCAP0_MAGIC):
        wrong.append(Problem(end, "the summary cannot be read"))

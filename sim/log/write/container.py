"""An MCAP file that takes whole chunks, so that a thousand messages cost as much as one.

`mcap.writer.Writer` takes one message at a time and spends about 4 us on each; four channels at 1 kHz would
cost more than the controller. The records themselves are `mcap`'s own (`mcap.records`). Each record is on the
disk's side of the process before the next begins, and a record that cannot be written whole is cut off again,
so that what is there can always be read.
"""

import json
import os
import struct
import zlib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import LIBRARY_IDENTIFIER, MCAP0_MAGIC
from numpy.typing import NDArray

from sim.errors import UserError
from sim.log.format import seal


def _encodable(text: str) -> str:
    """A text with escapes for what UTF-8 has no place for, such as bytes of a file name that are no text."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


class McapFile:
    """A new MCAP file: chunked, zstd, every CRC and index, never over an existing file."""

    def __init__(self, path: Path) -> None:
        """Create the file.

        Raises:
            UserError: it exists already or cannot be created.
        """
        self.path = path
        try:
            self._file = open(path, "xb", buffering=0)
        except FileExistsError:
            raise UserError(f"log {path} exists already; choose another path, none is overwritten") from None
        except OSError as error:
            raise UserError(f"cannot create log {path}: {error.strerror}") from error
        self._size = 0
        self._crc = 0
        self._finished = False
        self._schemas: dict[tuple[str, str, bytes], Schema] = {}
        self._channels: list[Channel] = []
        self._counts: dict[int, int] = {}
        self._chunks: list[ChunkIndex] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._said: dict[str, dict[str, str]] = {}
        self._attached: dict[str, tuple[str, bytes]] = {}
        self._seals: dict[int, seal.Seal] = {}
        self._compressor = zstandard.ZstdCompressor(level=1)
        try:
            self._write(MCAP0_MAGIC)
            self._record(Header(profile="", library=LIBRARY_IDENTIFIER))
        except BaseException:
            self._file.close()
            raise

    def attachment(self, name: str, media_type: str, data: bytes) -> None:
        """Add an attachment, times zero."""
        record = Attachment(create_time=0, log_time=0, name=name, media_type=media_type, data=data)
        offset, length = self._record(record)
        self._attached[name] = (media_type, data)
        self._attachments.append(
            AttachmentIndex(
                offset=offset,
                length=length,
                log_time=0,
                create_time=0,
                data_size=len(data),
                name=name,
                media_type=media_type,
            )
        )

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add a metadata record."""
        self._said[name] = {key: _encodable(text) for key, text in values.items()}
        offset, length = self._record(Metadata(name=name, metadata=self._said[name]))
        self._metadata.append(MetadataIndex(offset=offset, length=length, name=name))

    def channel(self, topic: str, schema_name: str, schema: bytes, metadata: Mapping[str, str]) -> int:
        """Register a protobuf channel.

        Args:
            topic: Its topic.
            schema_name: Full name of the message.
            schema: Serialised FileDescriptorSet.
            metadata: Channel metadata, such as units.

        Returns:
            Its channel id.
        """
        entry = self._schema(Schema(id=0, data=schema, encoding="protobuf", name=schema_name))
        return self._channel(topic, "protobuf", metadata, entry.id)

    def copy(self, channel: Channel, schema: Schema | None) -> int:
        """Register a channel of another file, of whatever encoding.

        Args:
            channel: It.
            schema: Its schema; None where it has none.

        Returns:
            Its channel id in this file.
        """
        schema_id = self._schema(schema).id if schema is not None else 0
        return self._channel(channel.topic, channel.message_encoding, channel.metadata, schema_id)

    def _schema(self, schema: Schema) -> Schema:
        """The record of a schema, written when it comes first."""
        key = (schema.name, schema.encoding, schema.data)
        if key not in self._schemas:
            self._schemas[key] = replace(schema, id=len(self._schemas) + 1)
            self._record(self._schemas[key])
        return self._schemas[key]

    def _channel(self, topic: str, encoding: str, metadata: Mapping[str, str], schema_id: int) -> int:
        channel = Channel(
            id=len(self._channels) + 1,
            topic=topic,
            message_encoding=encoding,
            metadata=dict(metadata),
            schema_id=schema_id,
        )
        self._record(channel)
        self._channels.append(channel)
        return channel.id

    def chunk(self, data: bytes, index: Mapping[int, NDArray[np.uint64]]) -> None:
        """Write message records as one chunk with its message indexes.

        Args:
            data: The message records, uncompressed.
            index: Channel id -> (log time in [ns], offset within `data`) of each message, (n, 2), n >= 1.
        """
        times = [entries[:, 0] for entries in index.values()]
        start, end = int(min(t.min() for t in times)), int(max(t.max() for t in times))
        compressed = self._compressor.compress(data)
        chunk = Chunk(
            compression="zstd",
            data=compressed,
            message_start_time=start,
            message_end_time=end,
            uncompressed_crc=zlib.crc32(data),
            uncompressed_size=len(data),
        )
        builder = RecordBuilder()
        chunk.write(builder)
        chunk_length = builder.count
        offsets = {}
        for channel_id, entries in index.items():
            offsets[channel_id] = self._size + builder.count
            body = entries.astype("<u8").tobytes()
            builder.write(struct.pack("<BQHI", Opcode.MESSAGE_INDEX, 6 + len(body), channel_id, len(body)))
            builder.write(body)
        record = ChunkIndex(
            chunk_length=chunk_length,
            chunk_start_offset=self._size,
            compression=chunk.compression,
            compressed_size=len(compressed),
            message_end_time=end,
            message_index_length=builder.count - chunk_length,
            message_index_offsets=offsets,
            message_start_time=start,
            uncompressed_size=len(data),
        )
        self._write(builder.end())
        self._chunks.append(record)
        everything = np.frombuffer(data, np.uint8)
        for channel_id, entries in index.items():
            self._counts[channel_id] = self._counts.get(channel_id, 0) + len(entries)
            self._seals.setdefault(channel_id, seal.Seal()).add_block(everything, entries)

    def signed(self, result: Mapping[str, str]) -> dict[str, str]:
        """A result with its signature over everything written so far."""
        names = {schema.id: schema for schema in self._schemas.values()}
        channels = {c.topic: (names[c.schema_id].name, names[c.schema_id].data, c.metadata) for c in self._channels}
        about = seal.about(self._said.get("run", {}), self._attached, channels)
        seals = {c.topic: self._seals.get(c.id, seal.Seal()) for c in self._channels}
        messages = {topic: (one.count, one.digest()) for topic, one in seals.items()}
        texts = {key: _encodable(text) for key, text in result.items()}
        return {**texts, seal.KEY: json.dumps(seal.signature(texts, messages, about))}

    @property
    def finished(self) -> bool:
        """Whether the file is closed."""
        return self._finished

    def finish(self) -> None:
        """Write the summary and close the file; a second call does nothing.

        Raises:
            UserError: the summary could not be written; the data before it can be read.
        """
        if self._finished:
            return
        self._finished = True
        try:
            tail = RecordBuilder()
            DataEnd(self._crc).write(tail)
            summary = self._summary(self._size + tail.count)
            self._write(tail.end() + summary + MCAP0_MAGIC)
        finally:
            self._file.close()

    def _summary(self, start: int) -> bytes:
        """Summary section and footer, for a summary that starts at byte `start`."""
        builder = RecordBuilder()
        groups: list[tuple[Opcode, list[Any]]] = [
            (Opcode.SCHEMA, list(self._schemas.values())),
            (Opcode.CHANNEL, list(self._channels)),
            (Opcode.STATISTICS, [self._statistics()]),
            (Opcode.CHUNK_INDEX, list(self._chunks)),
            (Opcode.ATTACHMENT_INDEX, list(self._attachments)),
            (Opcode.METADATA_INDEX, list(self._metadata)),
        ]
        offsets = []
        for opcode, records in groups:
            group_start = builder.count
            for record in records:
                record.write(builder)
            if builder.count > group_start:
                offsets.append(
                    SummaryOffset(
                        group_opcode=opcode,
                        group_start=start + group_start,
                        group_length=builder.count - group_start,
                    )
                )
        offset_start = start + builder.count
        for offset in offsets:
            offset.write(builder)
        body = builder.end()
        head = struct.pack("<BQQQ", Opcode.FOOTER, 8 + 8 + 4, start, offset_start)
        footer = RecordBuilder()
        Footer(
            summary_start=start,
            summary_offset_start=offset_start,
            summary_crc=zlib.crc32(head, zlib.crc32(body)),
        ).write(footer)
        return body + footer.end()

    def _statistics(self) -> Statistics:
        return Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=len(self._chunks),
            message_count=sum(self._counts.values()),
            message_end_time=max((c.message_end_time for c in self._chunks), default=0),
            message_start_time=min((c.message_start_time for c in self._chunks), default=0),
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )

    def _record(self, record: McapRecord) -> tuple[int, int]:
        """Write one record; its offset and length in bytes."""
        builder = RecordBuilder()
        record.write(builder)
        data = builder.end()
        offset = self._size
        self._write(data)
        return offset, len(data)

    def _write(self, data: bytes) -> None:
        """Write all of `data` or none of it."""
        try:
            view = memoryview(data)
            while view:
                view = view[self._file.write(view) :]
        except BaseException as error:
            os.ftruncate(self._file.fileno(), self._size)
            self._file.seek(self._size)
            if isinstance(error, OSError):
                kept = f"its first {self._size} bytes can be read"
                raise UserError(f"cannot write log {self.path}: {error.strerror}; {kept}") from error
            raise
        self._size += len(data)
        self._crc = zlib.crc32(data, self._crc)

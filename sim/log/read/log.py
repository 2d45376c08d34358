"""A log in memory: its tick channels as structured arrays, the rest as protobuf messages."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Channel, Schema
from numpy.typing import NDArray

from sim.errors import UserError
from sim.log.format.layout import HEADER, Layout, layout_of
from sim.log.format.topics import FORMAT, OWN
from sim.log.read.scan import Problem
from sim.log.read.schema import message_class


def time_ns(record: bytes) -> int:
    """Log time of a message record in [ns]."""
    return int.from_bytes(record[15:23], "little")


@dataclass(frozen=True, slots=True, kw_only=True)
class Container:
    """How a file holds its messages, which says nothing about them.

    Attributes:
        compressions: Of its chunks, "unchunked" where messages lie outside any.
        chunks: Bytes in each, unpacked.
        order: Digest of the order of this program's messages.
        foreign: Topics of other programs' channels.
        closed: Whether its closing bytes are there.
    """

    compressions: tuple[str, ...]
    chunks: tuple[int, ...]
    order: str
    foreign: tuple[str, ...]
    closed: bool

    def differences(self, other: "Container") -> list[str]:
        """What differs, a few words each."""
        words = []
        if self.compressions != other.compressions:
            words.append(f"compression {', '.join(self.compressions)} | {', '.join(other.compressions)}")
        if len(self.chunks) != len(other.chunks):
            words.append(f"{len(self.chunks)} | {len(other.chunks)} chunks")
        elif self.chunks != other.chunks:
            words.append("chunks of other sizes")
        if self.order != other.order:
            words.append("messages in another order")
        if self.foreign != other.foreign:
            names = (", ".join(one.foreign) or "none" for one in (self, other))
            words.append("foreign channels " + " | ".join(names))
        return words


@dataclass(eq=False)
class Log:
    """A log in memory.

    Attributes:
        path: Where it was read from.
        complete: Whether it was finished; False for a truncated file.
        ended: Whether its data came to their end; what is missing after them costs nothing.
        problems: What is damaged in it; empty for one that just stops.
        tolerant: Whether messages that do not match their schema are left out instead of refused.
        chunks: Bytes in each sound chunk, unpacked.
        metadata: Name of a metadata record -> its entries ("run", "result").
        attachments: File name -> (media type, content).
        channels: Topic -> channel record; another program's channel of a topic of ours has its id added.
        schemas: Schema id -> schema record.
        malformed: Topic -> messages left out so far.
        compressions: Of its chunks, "unchunked" where messages lie outside any.
    """

    path: Path
    complete: bool = False
    ended: bool = False
    problems: tuple[Problem, ...] = ()
    tolerant: bool = False
    chunks: tuple[int, ...] = ()
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: dict[str, tuple[str, bytes]] = field(default_factory=dict)
    channels: dict[str, Channel] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    malformed: dict[str, int] = field(default_factory=dict)
    compressions: tuple[str, ...] = ()
    _records: dict[int, list[bytes]] = field(default_factory=dict, repr=False)
    _order: Sequence[int] = field(default=(), repr=False)
    _types: dict[int, Any] = field(default_factory=dict, repr=False)
    _layouts: dict[int, Layout | None] = field(default_factory=dict, repr=False)

    def is_own(self, topic: str) -> bool:
        """Whether a channel is one of this program's, by topic and name of its message."""
        channel = self.channels.get(topic)
        schema = self.schemas.get(channel.schema_id) if channel else None
        return schema is not None and OWN.get(topic) == schema.name and schema.encoding == "protobuf"

    @property
    def own(self) -> list[str]:
        """Topics of this program's channels."""
        return [topic for topic in self.channels if self.is_own(topic)]

    @property
    def foreign(self) -> list[str]:
        """Topics of other programs' channels: kept, shown, never judged."""
        return [topic for topic in self.channels if not self.is_own(topic)]

    @property
    def format(self) -> int | None:
        """Version of topics, fields and metadata; None where the log does not say."""
        text = self.metadata.get("run", {}).get("format", "")
        return int(text) if text.isascii() and text.isdecimal() and len(text) < 9 else None

    @property
    def unknown_format(self) -> str:
        """What is wrong with the format's version, "" if nothing is."""
        said = self.metadata.get("run", {}).get("format")
        if said is None or (self.format and self.format <= FORMAT):
            return ""
        if self.format and self.format > FORMAT:
            return f"is of log format {self.format}; this program reads 1 to {FORMAT}: a newer one is needed"
        return f"names {said[:40]!r} as its log format: must be 1 to {FORMAT}"

    @cached_property
    def container(self) -> Container:
        """How the file holds its messages."""
        topics = {channel.id: topic for topic, channel in self.channels.items() if self.is_own(topic)}
        order = sha256("\n".join(topics[i] for i in self._order if i in topics).encode()).hexdigest()
        return Container(
            compressions=self.compressions,
            chunks=self.chunks,
            order=order,
            foreign=tuple(sorted(self.foreign)),
            closed=self.complete,
        )

    @property
    def unread(self) -> Mapping[int, list[bytes]]:
        """Channel id -> message records, those of no channel that is described included."""
        return self._records

    def channel(self, topic: str) -> NDArray[Any]:
        """Every message of a per-tick channel as one structured array, in order of time.

        Fields are `_tick`, `_time_ns`, `_publish_ns`, then the dotted field names of the schema in the file.

        Args:
            topic: Such as "/control".

        Raises:
            UserError: no such channel, or its messages have no fixed layout.
        """
        self._message_type(topic)
        layout, records = self._layout(topic), self.records(topic)
        if layout is None:
            raise UserError(f"{self.path}: {topic} is not a per-tick channel: its messages have no fixed layout")
        dtype = layout.record_dtype
        whole = [record for record in records if len(record) == dtype.itemsize]
        data = np.frombuffer(b"".join(whole), np.uint8).reshape(-1, dtype.itemsize)
        good = layout.fits(data)
        wrong = len(records) - int(good.sum())
        if wrong and not self.tolerant:
            raise UserError(f"{self.path}: {_messages(wrong)} of {topic} do not match the schema")
        self.malformed[topic] = wrong
        rows = (data if good.all() else data[good]).reshape(-1).view(dtype)
        return self._with_ticks(rows)

    def _with_ticks(self, rows: NDArray[Any]) -> NDArray[Any]:
        """Ticks from times, where a program that copied the log did not keep sequence numbers."""
        period = self.metadata.get("run", {}).get("period_ns", "")
        if len(rows) < 2 or rows["_tick"].any() or not (period.isdecimal() and 0 < int(period[:12])):
            return rows
        rows = rows.copy()
        rows["_tick"] = rows["_time_ns"] // np.uint64(int(period[:12]))
        return rows

    def decoded(self, topic: str) -> Iterator[tuple[bytes, Any]]:
        """Every message of a channel: (record, message decoded by protobuf), in order of time.

        Raises:
            UserError: no such channel, or a message cannot be decoded.
        """
        kind = self._message_type(topic)
        self.malformed[topic] = 0
        for record in self.records(topic):
            try:
                message = kind.FromString(record[HEADER:])
            except Exception as error:
                if not self.tolerant:
                    raise UserError(f"{self.path}: a message of {topic} cannot be decoded: {error}") from error
                self.malformed[topic] += 1
                continue
            yield record, message

    def messages(self, topic: str) -> list[tuple[int, Any]]:
        """Every message of a channel, decoded by protobuf: (log time in [ns], message)."""
        return [(time_ns(record), message) for record, message in self.decoded(topic)]

    def records(self, topic: str) -> list[bytes]:
        """Every message record of a channel as bytes, in order of time: `HEADER` bytes, then the message."""
        return self._records.get(self._channel(topic).id, [])

    def has_layout(self, topic: str) -> bool:
        """Whether the channel's messages have a fixed layout, so that `channel` can read them."""
        try:
            self._message_type(topic)
        except UserError:
            return False
        return self._layout(topic) is not None

    def _layout(self, topic: str) -> Layout | None:
        schema_id = self._channel(topic).schema_id
        if schema_id not in self._layouts:
            try:
                self._layouts[schema_id] = layout_of(self._message_type(topic).DESCRIPTOR)
            except ValueError:
                self._layouts[schema_id] = None
        return self._layouts[schema_id]

    def units(self, topic: str) -> dict[str, str]:
        """Unit of each field of a channel of our own, by dotted name."""
        return self._texts(topic, "units")

    def descriptions(self, topic: str) -> dict[str, str]:
        """Meaning of each field of a channel of our own, by dotted name."""
        return self._texts(topic, "descriptions")

    def _texts(self, topic: str, key: str) -> dict[str, str]:
        try:
            texts = json.loads(self._channel(topic).metadata.get(key, "{}"))
        except (ValueError, RecursionError):
            texts = None
        if isinstance(texts, dict):
            return {str(name): str(text) for name, text in texts.items()}
        if self.tolerant or not self.is_own(topic):
            return {}
        raise UserError(f"{self.path}: {key} of {topic} are no JSON object")

    def fields(self, topic: str) -> list[tuple[str, int, int]]:
        """Name, number and type of each field of a channel's messages, nested ones included.

        Raises:
            UserError: the schema cannot be read.
        """
        listed: list[tuple[str, int, int]] = []
        waiting, met = [("", self._message_type(topic).DESCRIPTOR)], set()
        while waiting:
            prefix, message = waiting.pop(0)
            if message.full_name in met:
                continue
            met.add(message.full_name)
            for entry in message.fields:
                listed.append((prefix + entry.name, entry.number, entry.type))
                if entry.message_type is not None:
                    waiting.append((f"{prefix}{entry.name}.", entry.message_type))
        return listed

    def enums(self, topic: str) -> dict[str, dict[int, str]]:
        """Dotted name of each enum field of a channel -> names of its codes."""
        return {
            entry.name: {value.number: value.name for value in entry.enum_type.values}
            for entry in self._message_type(topic).DESCRIPTOR.fields
            if entry.enum_type is not None
        }

    def _channel(self, topic: str) -> Channel:
        if topic not in self.channels:
            raise UserError(f"{self.path} has no channel {topic}; it has {sorted(self.channels)}")
        return self.channels[topic]

    def _message_type(self, topic: str) -> Any:
        channel = self._channel(topic)
        if channel.schema_id not in self._types:
            self._types[channel.schema_id] = message_class(channel, self.schemas.get(channel.schema_id))
        kind = self._types[channel.schema_id]
        if isinstance(kind, str):
            raise UserError(f"{self.path}: schema of {topic} cannot be read: {kind}")
        return kind


def _messages(count: int) -> str:
    return "a message" if count == 1 else f"{count} messages"

"""Where each number sits in the bytes of a message, when every field is written and has a fixed size.

Protobuf lets a writer emit zeros explicitly and does not ask for more: with doubles, sfixed32, bools and
enums below 128 the tags and lengths are constant, so a block of messages is a numpy structured array over a
constant template. One walk over the descriptor serves the writer and the reader; a reader that takes the
descriptor from the file reads logs of other versions too.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.descriptor_pb2 import DescriptorProto, FieldDescriptorProto
from numpy.typing import NDArray

from sim.log.format.fields import ChannelTable
from sim.log.format.schema import descriptor

HEADER = 31
"""Bytes of an MCAP message record before its data: opcode, length, channel id, sequence, two times."""

_DEEPEST = 8  # levels of nested messages; a schema read from a file could be recursive
_LONGEST = 2**16  # [B] of a message; a few nested ones that use each other could stand for gigabytes
_VARINT, _FIXED64, _LENGTH, _FIXED32 = 0, 1, 2, 5
_SCALARS = {
    FieldDescriptor.TYPE_DOUBLE: (_FIXED64, "<f8"),
    FieldDescriptor.TYPE_SFIXED32: (_FIXED32, "<i4"),
    FieldDescriptor.TYPE_BOOL: (_VARINT, "?"),
    FieldDescriptor.TYPE_ENUM: (_VARINT, "u1"),
}


@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """Fixed layout of one message type.

    Attributes:
        template: The message with every number zero.
        names: Dotted field names.
        formats: numpy format of each field.
        offsets: Byte offset of each field within the message.
    """

    template: bytes
    names: tuple[str, ...]
    formats: tuple[str, ...]
    offsets: tuple[int, ...]

    @property
    def dtype(self) -> np.dtype[Any]:
        """Structured dtype that views the bytes of a message."""
        return np.dtype(
            {
                "names": list(self.names),
                "formats": list(self.formats),
                "offsets": list(self.offsets),
                "itemsize": len(self.template),
            }
        )

    @property
    def record_dtype(self) -> np.dtype[Any]:
        """Structured dtype that views a whole MCAP message record: `_tick`, `_time_ns`, the fields."""
        return np.dtype(
            {
                "names": ["_tick", "_time_ns", "_publish_ns", *self.names],
                "formats": ["<u4", "<u8", "<u8", *self.formats],
                "offsets": [11, 15, 23, *(HEADER + offset for offset in self.offsets)],
                "itemsize": HEADER + len(self.template),
            }
        )

    def fits(self, records: NDArray[np.uint8]) -> NDArray[np.bool_]:
        """Whether the tags and lengths of each record are the template's, (n,).

        Args:
            records: Bytes of n message records, (n, itemsize of `record_dtype`).
        """
        constant = np.ones(len(self.template), dtype=bool)
        for offset, form in zip(self.offsets, self.formats, strict=True):
            constant[offset : offset + np.dtype(form).itemsize] = False
        where = np.flatnonzero(constant)
        expected = np.frombuffer(self.template, np.uint8)[where]
        return np.asarray((records[:, HEADER + where] == expected).all(axis=1))


def layout_of(message: Any) -> Layout:
    """Lay out a message type.

    Args:
        message: Protobuf message descriptor.

    Raises:
        ValueError: a field has no fixed size (string, repeated, plain integer).
    """
    template, entries = _walk(message, "")
    if not entries:
        raise ValueError(f"{message.full_name} has no fields")
    names, formats, offsets = zip(*entries, strict=True)
    return Layout(template, names, formats, offsets)


def numpy_dtype(channel: ChannelTable) -> np.dtype[Any]:
    """Structured dtype that views the raw message bytes of a per-tick channel, fields by dotted name."""
    return layout_of(descriptor(channel)).dtype


def _walk(message: Any, prefix: str) -> tuple[bytes, list[tuple[str, str, int]]]:
    if prefix.count(".") > _DEEPEST:
        raise ValueError(f"{message.full_name} is nested more than {_DEEPEST} deep")
    proto = DescriptorProto()
    message.CopyToProto(proto)
    repeated = {f.name for f in proto.field if f.label == FieldDescriptorProto.LABEL_REPEATED}
    body = b""
    entries: list[tuple[str, str, int]] = []
    for field in message.fields:
        if field.name in repeated:
            raise ValueError(f"{field.full_name} is repeated: its size is not fixed")
        if field.type == FieldDescriptor.TYPE_MESSAGE:
            inner, nested = _walk(field.message_type, f"{prefix}{field.name}.")
            body += _varint(field.number << 3 | _LENGTH) + _varint(len(inner))
            entries += [(name, form, len(body) + offset) for name, form, offset in nested]
            body += inner
        elif field.type in _SCALARS:
            wire, form = _SCALARS[field.type]
            body += _varint(field.number << 3 | wire)
            entries.append((prefix + field.name, form, len(body)))
            body += bytes(np.dtype(form).itemsize)
        else:
            raise ValueError(f"{field.full_name} has no fixed size on the wire")
        if len(body) > _LONGEST:
            raise ValueError(f"{message.full_name} has more than {_LONGEST} bytes")
    return body, entries


def _varint(value: int) -> bytes:
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)

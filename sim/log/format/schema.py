"""From the field table to protobuf descriptors, at import: no protoc, no generated files."""

import json
from typing import Any

from google.protobuf import descriptor_pool, message_factory
from google.protobuf.descriptor_pb2 import (
    DescriptorProto,
    FieldDescriptorProto,
    FileDescriptorProto,
    FileDescriptorSet,
)

from sim.log.format.fields import (
    ENUMS,
    PACKAGE,
    TABLES,
    ChannelTable,
    Field,
    Kind,
)

_TYPES = {
    Kind.DOUBLE: FieldDescriptorProto.TYPE_DOUBLE,
    Kind.BOOL: FieldDescriptorProto.TYPE_BOOL,
    Kind.INT32: FieldDescriptorProto.TYPE_SFIXED32,
    Kind.LEG: FieldDescriptorProto.TYPE_ENUM,
    Kind.STATUS: FieldDescriptorProto.TYPE_ENUM,
    Kind.SERIES: FieldDescriptorProto.TYPE_DOUBLE,
}


def _camel(name: str) -> str:
    return "".join(part.capitalize() for part in name.split("_"))


def _fill(message: DescriptorProto, scope: str, fields: list[tuple[str, Field]]) -> None:
    """Add fields to a message; names that share a first part become one nested message."""
    groups: dict[str, list[tuple[str, Field]]] = {}
    for name, field in fields:
        head, _, rest = name.partition(".")
        groups.setdefault(head, []).append((rest, field))
    for number, (head, members) in enumerate(groups.items(), start=1):
        entry = message.field.add(name=head, number=number, label=FieldDescriptorProto.LABEL_OPTIONAL)
        rest, field = members[0]
        if rest:
            nested = message.nested_type.add(name=_camel(head))
            entry.type = FieldDescriptorProto.TYPE_MESSAGE
            entry.type_name = f"{scope}.{nested.name}"
            _fill(nested, entry.type_name, members)
            continue
        entry.type = _TYPES[field.kind]
        if field.kind is Kind.SERIES:
            entry.label = FieldDescriptorProto.LABEL_REPEATED
        if field.kind in ENUMS:
            entry.type_name = f".{PACKAGE}.{field.kind.value}"


def _file() -> FileDescriptorProto:
    file = FileDescriptorProto(name=f"{PACKAGE}/log.proto", package=PACKAGE, syntax="proto3")
    for kind, names in ENUMS.items():
        enum = file.enum_type.add(name=kind.value)
        for code, name in enumerate(names):
            enum.value.add(name=name.upper().replace("-", "_"), number=code)
    for channel in TABLES:
        message = file.message_type.add(name=channel.message)
        _fill(message, f".{PACKAGE}.{channel.message}", [(f.name, f) for f in channel.fields])
    return file


_POOL = descriptor_pool.DescriptorPool()
_FILE = _file()
_POOL.Add(_FILE)

SCHEMA = FileDescriptorSet(file=[_FILE]).SerializeToString(deterministic=True)
"""Serialised FileDescriptorSet of every channel of our own, the schema data MCAP asks for."""


def schema_of(channel: ChannelTable) -> bytes:
    """Schema data of a channel that stands in no table, of its own file."""
    file = FileDescriptorProto(name=f"{PACKAGE}/{channel.message.lower()}.proto", package=PACKAGE, syntax="proto3")
    message = file.message_type.add(name=channel.message)
    _fill(message, f".{PACKAGE}.{channel.message}", [(f.name, f) for f in channel.fields])
    return FileDescriptorSet(file=[file]).SerializeToString(deterministic=True)


def full_name(channel: ChannelTable) -> str:
    """Name of the channel's message with its package."""
    return f"{PACKAGE}.{channel.message}"


def descriptor(channel: ChannelTable) -> Any:
    """Protobuf descriptor of the channel's message."""
    return _POOL.FindMessageTypeByName(full_name(channel))


def message_class(channel: ChannelTable) -> Any:
    """Protobuf class of the channel's message."""
    return message_factory.GetMessageClass(descriptor(channel))


def channel_metadata(channel: ChannelTable) -> dict[str, str]:
    """Units and meanings of the channel's fields, as JSON objects keyed by dotted field name."""
    return {
        "units": json.dumps({f.name: f.unit for f in channel.fields}),
        "descriptions": json.dumps({f.name: f.description for f in channel.fields}),
    }


def closure(file: Any) -> bytes:
    """Serialised FileDescriptorSet of a file and all it depends on, dependencies first.

    Args:
        file: A protobuf FileDescriptor, such as that of a well-known Foxglove schema.
    """
    files: dict[str, Any] = {}

    def visit(descriptor: Any) -> None:
        for dependency in descriptor.dependencies:
            visit(dependency)
        files.setdefault(descriptor.name, descriptor)

    visit(file)
    found = FileDescriptorSet()
    for one in files.values():
        one.CopyToProto(found.file.add())
    return found.SerializeToString(deterministic=True)

"""The schema that a file gives for a channel, read as little believed as the rest of it."""

from typing import Any

from google.protobuf import descriptor_pool, message_factory
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap.records import Channel, Schema

LARGEST_SCHEMA = 2**20  # [B]; ours have 10 kB


def message_class(channel: Channel, schema: Schema | None) -> Any:
    """The message class of a channel, or why there is none."""
    if schema is None:
        return "it is missing"
    if schema.encoding != "protobuf" or channel.message_encoding != "protobuf":
        return f"it is {schema.encoding[:40]!r}, not protobuf"
    if len(schema.data) > LARGEST_SCHEMA:
        return f"it has {len(schema.data)} bytes, at most {LARGEST_SCHEMA} are read"
    try:
        pool = descriptor_pool.DescriptorPool()
        for file in FileDescriptorSet.FromString(schema.data).file:
            pool.Add(file)
        return message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))
    except Exception as error:  # whatever protobuf raises for a descriptor that contradicts itself
        return str(error) or type(error).__name__

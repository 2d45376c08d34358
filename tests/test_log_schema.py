"""The field table, and what is derived from it."""

import json
import struct

import numpy as np
import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorSet

from sim.interface import LEGS
from sim.log.format.fields import (
    CHANNELS,
    ENUMS,
    STATUSES,
    TABLES,
    Kind,
)
from sim.log.format.layout import layout_of, numpy_dtype
from sim.log.format.schema import SCHEMA, channel_metadata, descriptor, full_name, message_class

SAMPLES = {
    Kind.DOUBLE: (-1.25, 0.0, float("inf"), 5e-324),
    Kind.BOOL: (True, False),
    Kind.INT32: (-1, 0, 2**31 - 1),
    Kind.LEG: tuple(range(len(LEGS))),
    Kind.STATUS: tuple(range(len(STATUSES))),
}
each_channel = pytest.mark.parametrize("channel", CHANNELS, ids=lambda c: c.topic)


def follow(message, dotted):
    for part in dotted.split("."):
        message = getattr(message, part)
    return message


@each_channel
def test_layout_has_every_field_of_the_table_in_order(channel):
    assert layout_of(descriptor(channel)).names == tuple(f.name for f in channel.fields)


@each_channel
def test_packed_bytes_parse_back_to_what_was_packed(channel):
    dtype = numpy_dtype(channel)
    for turn in range(5):
        raw = np.frombuffer(bytearray(layout_of(descriptor(channel)).template), dtype)
        packed = {}
        for i, field in enumerate(channel.fields):
            samples = SAMPLES[field.kind]
            packed[field.name] = samples[(i + turn) % len(samples)]
            raw[field.name] = packed[field.name]
        message = message_class(channel).FromString(raw.tobytes())
        assert {name: follow(message, name) for name in packed} == packed
        assert message_class(channel).FromString(message.SerializeToString()) == message


@each_channel
def test_packed_bytes_are_protobuf_s_own_when_no_field_is_zero(channel):
    """Explicit zeros are the only difference to what protobuf itself writes."""
    raw = np.frombuffer(bytearray(layout_of(descriptor(channel)).template), numpy_dtype(channel))
    for i, field in enumerate(channel.fields, start=1):
        raw[field.name] = i if field.kind in (Kind.DOUBLE, Kind.INT32) else 1
    message = message_class(channel).FromString(raw.tobytes())
    assert message.SerializeToString(deterministic=True) == raw.tobytes()


@each_channel
def test_nan_survives(channel):
    raw = np.frombuffer(bytearray(layout_of(descriptor(channel)).template), numpy_dtype(channel))
    doubles = [f.name for f in channel.fields if f.kind is Kind.DOUBLE]
    for name in doubles:
        raw[name] = np.nan
    message = message_class(channel).FromString(raw.tobytes())
    assert all(np.isnan(follow(message, name)) for name in doubles)


@each_channel
def test_every_number_has_a_unit_and_every_field_a_meaning(channel):
    metadata = channel_metadata(channel)
    units, meanings = json.loads(metadata["units"]), json.loads(metadata["descriptions"])
    for field in channel.fields:
        assert meanings[field.name]
        assert bool(units[field.name]) == (field.kind in (Kind.DOUBLE, Kind.INT32)), field.name


def test_names_are_unique_and_groups_contiguous():
    for channel in CHANNELS:
        names = [f.name for f in channel.fields]
        assert len(set(names)) == len(names)
        heads = [name.partition(".")[0] for name in names]
        changes = [head for i, head in enumerate(heads) if i == 0 or heads[i - 1] != head]
        assert len(set(changes)) == len(changes)


def test_enum_codes_fit_one_byte():
    assert all(len(names) <= 127 for names in ENUMS.values())


def test_schema_is_self_contained():
    files = FileDescriptorSet.FromString(SCHEMA).file
    found = {f"{file.package}.{message.name}" for file in files for message in file.message_type}
    assert found == {full_name(channel) for channel in TABLES}
    assert not any(file.dependency for file in files)


def test_a_type_of_no_fixed_size_is_refused():
    from foxglove_schemas_protobuf.Log_pb2 import Log

    with pytest.raises(ValueError, match="no fixed size"):
        layout_of(Log.DESCRIPTOR)


def test_double_bytes_are_little_endian_fixed64():
    timing = next(c for c in CHANNELS if c.topic == "/timing")
    raw = np.frombuffer(bytearray(layout_of(descriptor(timing)).template), numpy_dtype(timing))
    raw["tick"], raw["solve"] = 1.5, 2.5
    assert raw.tobytes() == struct.pack("<BdBd", 0x09, 1.5, 0x11, 2.5)

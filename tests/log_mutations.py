"""Mutations of a log by seed: some keep every message, some change what it says, some just damage the file."""

import json
import struct
import zlib
from dataclasses import dataclass, field, replace
from io import BytesIO
from pathlib import Path

import lz4.frame
import numpy as np
import zstandard
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Attachment, Channel, Chunk, Message, Metadata, Schema
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer

KEEPS, CHANGES, DAMAGES = "keeps", "changes", "damages"
"""Whether every message and all that is said of the run stays; or something of it is another; or bytes are wrong."""


@dataclass
class Parts:
    """A log in parts, to be put together otherwise."""

    metadata: list[tuple[str, dict[str, str]]]
    attachments: list[tuple[str, str, bytes]]
    schemas: dict[int, Schema]
    channels: dict[int, Channel]
    messages: list[Message] = field(default_factory=list)

    @classmethod
    def of(cls, data: bytes) -> "Parts":
        reader = make_reader(BytesIO(data))
        summary = reader.get_summary()
        parts = cls(
            [(m.name, dict(m.metadata)) for m in reader.iter_metadata()],
            [(a.name, a.media_type, a.data) for a in reader.iter_attachments()],
            dict(summary.schemas),
            dict(summary.channels),
        )
        parts.messages = [message for _, _, message in reader.iter_messages(log_time_order=False)]
        return parts

    def write(self, **options) -> bytes:
        out = BytesIO()
        writer = Writer(out, **{"compression": CompressionType.ZSTD, "chunk_size": 200_000} | options)
        writer.start(profile="", library="mutated")
        for name, values in self.metadata:
            writer.add_metadata(name, values)
        for name, kind, content in self.attachments:
            writer.add_attachment(0, 0, name, kind, content)
        schemas = {0: 0} | {
            key: writer.register_schema(s.name, s.encoding, s.data) for key, s in sorted(self.schemas.items())
        }
        channels = {
            key: writer.register_channel(c.topic, c.message_encoding, schemas[c.schema_id], c.metadata)
            for key, c in sorted(self.channels.items())
        }
        for m in self.messages:
            writer.add_message(channels[m.channel_id], m.log_time, m.data, m.publish_time, m.sequence)
        writer.finish()
        return out.getvalue()

    def said(self, name: str) -> dict[str, str]:
        return next(values for key, values in self.metadata if key == name)

    def of_topic(self, topic: str) -> list[int]:
        return [i for i, m in enumerate(self.messages) if self.channels[m.channel_id].topic == topic]


# What keeps every message


def lz4_chunks(data, rng):
    return Parts.of(data).write(compression=CompressionType.LZ4)


def plain_chunks(data, rng):
    return Parts.of(data).write(compression=CompressionType.NONE, chunk_size=int(rng.integers(1000, 10**6)))


def unchunked(data, rng):
    return Parts.of(data).write(use_chunking=False)


def other_chunks(data, rng):
    return Parts.of(data).write(chunk_size=int(rng.integers(500, 10**6)))


def without_summary(data, rng):
    options = ("use_statistics", "use_summary_offsets", "repeat_channels", "repeat_schemas")
    return Parts.of(data).write(**{name: bool(rng.integers(2)) for name in options})


def by_topic(data, rng):
    parts = Parts.of(data)
    parts.messages.sort(key=lambda m: m.channel_id)
    return parts.write()


def shuffled(data, rng):
    parts = Parts.of(data)
    parts.messages = [parts.messages[i] for i in rng.permutation(len(parts.messages))]
    return parts.write()


def renumbered(data, rng):
    parts = Parts.of(data)
    new = dict(zip(parts.channels, rng.permutation(np.arange(100, 100 + len(parts.channels))).tolist(), strict=True))
    parts.channels = {new[key]: replace(c, id=new[key]) for key, c in parts.channels.items()}
    for m in parts.messages:
        m.channel_id = new[m.channel_id]
    return parts.write()


def with_foreign(data, rng):
    parts = Parts.of(data)
    json_schema = Schema(id=900, name="note", encoding="jsonschema", data=b'{"type": "object"}')
    parts.schemas[900] = json_schema
    topics = ("/control", "/camera", "/plant/state", "/diagnostics")
    for number in range(int(rng.integers(1, 4))):
        key, schemaless = 900 + number, bool(rng.integers(2))
        parts.channels[key] = Channel(
            id=key,
            topic=topics[int(rng.integers(len(topics)))],
            message_encoding="json",
            metadata={},
            schema_id=0 if schemaless else 900,
        )
        for i in range(int(rng.integers(0, 50))):
            text = json.dumps({"i": i}).encode()
            at = int(rng.integers(len(parts.messages) + 1))
            parts.messages.insert(at, Message(key, int(rng.integers(10**9)), text, 0, i))
    return parts.write(compression=(CompressionType.LZ4, CompressionType.ZSTD)[int(rng.integers(2))])


def without_sequence(data, rng):
    parts = Parts.of(data)
    for m in parts.messages:
        m.sequence = 0
    return parts.write()


# What changes something, every CRC right


def other_outcome(data, rng):
    parts = Parts.of(data)
    result = parts.said("result")
    result["outcome"] = str(rng.choice(["completed", "fell", "interrupted", "garbage"]))
    result["steps"] = str(int(result["steps"]) + int(rng.integers(1, 9)))
    return parts.write()


def other_figure(data, rng):
    parts = Parts.of(data)
    result = parts.said("result")
    names = [n for n in result if n not in ("signature", "outcome", "log")]
    result[str(rng.choice(names))] = str(rng.choice(["0.5", "7", '"words"', "{}", "null", "nonsense", "1e999"]))
    return parts.write()


def other_run(data, rng):
    parts = Parts.of(data)
    run = parts.said("run")
    names = [n for n in run if n != "format"]
    run[str(rng.choice(names))] = str(rng.choice(["0.5", "garbage", "{}", "[[", "\x1b[2J", "999999999999999999"]))
    return parts.write()


def other_format(data, rng):
    parts = Parts.of(data)
    parts.said("run")["format"] = str(rng.choice(["99", "3", "0", "-1", "two", "1e9", ""]))
    return parts.write()


def dropped_metadata(data, rng):
    parts = Parts.of(data)
    parts.metadata.pop(int(rng.integers(len(parts.metadata))))
    return parts.write()


def dropped_channel(data, rng):
    parts = Parts.of(data)
    key = int(
        rng.choice([k for k, c in parts.channels.items() if c.topic in ("/control", "/mpc", "/plant/state", "/events")])
    )
    parts.channels.pop(key)
    parts.messages = [m for m in parts.messages if m.channel_id != key]
    return parts.write()


def dropped_messages(data, rng):
    parts = Parts.of(data)
    for _ in range(int(rng.integers(1, 5))):
        parts.messages.pop(int(rng.integers(len(parts.messages))))
    return parts.write()


def repeated_messages(data, rng):
    parts = Parts.of(data)
    at = int(rng.integers(len(parts.messages)))
    parts.messages.insert(at, parts.messages[int(rng.integers(len(parts.messages)))])
    return parts.write()


def other_bits(data, rng):
    """A bit of one message."""
    parts = Parts.of(data)
    message = parts.messages[int(rng.integers(len(parts.messages)))]
    content = bytearray(message.data)
    content[int(rng.integers(len(content)))] ^= 1 << int(rng.integers(8))
    message.data = bytes(content)
    return parts.write()


def malformed_message(data, rng):
    parts = Parts.of(data)
    message = parts.messages[int(rng.integers(len(parts.messages)))]
    message.data = rng.bytes(int(rng.integers(0, 300)))
    return parts.write()


def other_times(data, rng):
    parts = Parts.of(data)
    message = parts.messages[int(rng.integers(len(parts.messages)))]
    message.log_time = int(rng.integers(2**63))
    return parts.write()


def other_event(data, rng):
    """One of the events says something else, or comes elsewhere, or is gone, or new."""
    parts = Parts.of(data)
    places = parts.of_topic("/events")
    at = int(rng.choice(places))
    content = parts.messages[at].data
    kind = int(rng.integers(3))
    if kind == 0:
        parts.messages[at].data = content.replace(b"step", b"stop").replace(b"after", b"aftr").replace(b"push", b"pusx")
        if parts.messages[at].data == content:
            parts.messages.pop(at)
    elif kind == 1:
        parts.messages.pop(at)
    else:
        parts.messages.insert(at, replace(parts.messages[at], log_time=parts.messages[at].log_time + 10**6))
    return parts.write()


def other_schema(data, rng):
    """Fields of a schema named otherwise, or a schema that cannot be read, or units that are others."""
    parts = Parts.of(data)
    key = int(rng.choice(list(parts.channels)))
    schema = parts.schemas[parts.channels[key].schema_id]
    kind = int(rng.integers(3))
    if kind == 0:
        schema.data = rng.bytes(int(rng.integers(0, 200)))
    elif kind == 1:
        files = FileDescriptorSet.FromString(schema.data)
        message = files.file[-1].message_type[int(rng.integers(len(files.file[-1].message_type)))]
        message.field[0].name = "renamed"
        schema.data = files.SerializeToString()
    else:
        parts.channels[key].metadata = {"units": '{"theta": "kN"}' if rng.integers(2) else "[["}
    return parts.write()


def other_attachment(data, rng):
    parts = Parts.of(data)
    i = int(rng.integers(len(parts.attachments)))
    name, kind, content = parts.attachments[i]
    deep = b"a = " + b"[" * 5000
    content = [content[: len(content) // 2], b"", deep, content + b" ", rng.bytes(100)][int(rng.integers(5))]
    parts.attachments[i] = (name, kind, content)
    return parts.write()


def dropped_attachment(data, rng):
    parts = Parts.of(data)
    parts.attachments.pop(int(rng.integers(len(parts.attachments))))
    return parts.write()


def hungry_scenario(data, rng):
    """A scenario that asks for a lot."""
    parts = Parts.of(data)
    i = next(i for i, (name, _, _) in enumerate(parts.attachments) if name == "scenario.toml")
    name, kind, content = parts.attachments[i]
    lines = [line for line in content.split(b"\n") if not line.startswith((b"steps", b"time_limit"))]
    more = [b"steps = 1000000000", b"time_limit = 1e9", b"steps = 99999999999999999999"][int(rng.integers(3))]
    parts.attachments[i] = (name, kind, b"\n".join([more, *lines]))
    return parts.write()


# What damages the file


def flipped_bits(data, rng):
    out = bytearray(data)
    for _ in range(int(rng.integers(1, 4))):
        out[int(rng.integers(len(out)))] ^= 1 << int(rng.integers(8))
    return bytes(out)


def cut_off(data, rng):
    return data[: int(rng.integers(8, len(data)))]


def cut_out(data, rng):
    a, b = sorted(int(x) for x in rng.integers(8, len(data), 2))
    return data[:a] + data[b:]


def noise_within(data, rng):
    at = int(rng.integers(8, len(data)))
    return data[:at] + rng.bytes(int(rng.integers(1, 5000))) + data[at:]


def zeros_within(data, rng):
    at, count = int(rng.integers(8, len(data))), int(rng.integers(1, 5000))
    return data[:at] + bytes(count) + data[at + count :]


def flipped_bits_unchunked(data, rng):
    return flipped_bits(unchunked(data, rng), rng)


def bomb(data, rng):
    """Chunks that unpack to a lot: of zeros, of tiny messages, of one huge message."""
    kind = int(rng.integers(4))
    if kind == 0:
        content = bytes(60 * 2**20)
    elif kind == 1:
        content = struct.pack("<BQHIQQ", Opcode.MESSAGE, 22, 1, 0, 0, 0) * (2 * 2**20)
    elif kind == 2:
        content = struct.pack("<BQHIQQ", Opcode.MESSAGE, 22 + 50 * 2**20, 7, 0, 0, 0) + bytes(50 * 2**20)
    else:
        content = struct.pack("<BQ", Opcode.SCHEMA, 4) * (4 * 2**20)
    packed = zstandard.ZstdCompressor(level=1).compress(content) if kind % 2 else lz4.frame.compress(content)
    builder = RecordBuilder()
    for _ in range(int(rng.integers(1, 30))):
        Chunk("zstd" if kind % 2 else "lz4", packed, 0, 0, zlib.crc32(content), len(content)).write(builder)
    at = data.index(b"zstd") - 41  # before the first chunk
    return data[:at] + builder.end() + data[at:]


def counts(data, rng):
    """Very many schemas, channels, metadata or attachments, all tiny."""
    builder = RecordBuilder()
    kind, n = int(rng.integers(4)), int(rng.integers(1000, 30_000))
    for i in range(n):
        if kind == 0:
            Schema(id=i % 60_000 + 20, name=f"s{i}", encoding="protobuf", data=b"").write(builder)
        elif kind == 1:
            Channel(id=i % 60_000 + 20, topic=f"/t{i}", message_encoding="x", metadata={}, schema_id=0).write(builder)
        elif kind == 2:
            Metadata(name=f"m{i}", metadata={"a": "b"}).write(builder)
        else:
            Attachment(create_time=0, log_time=0, name=f"a{i}", media_type="", data=b"").write(builder)
    at = len(MCAP0_MAGIC)
    return data[:at] + builder.end() + data[at:]


def series_of_holes(data, rng):
    """A series that is long once and empty ever after."""
    parts = Parts.of(data)
    key = next(k for k, c in parts.channels.items() if c.topic == "/prediction")
    n = int(rng.integers(500, 1900))
    long = bytes([0x0A, *_varint(8 * n + 4), 0x0A, *_varint(8 * n)]) + bytes(8 * n)
    for i in range(int(rng.integers(1000, 60_000))):
        parts.messages.append(Message(key, 10**9 + i, long if i == 0 else b"", 0, i))
    return parts.write()


def _varint(value: int) -> bytes:
    out = bytearray()
    while value > 127:
        out.append(value & 127 | 128)
        value >>= 7
    out.append(value)
    return bytes(out)


MUTATIONS = {
    KEEPS: (
        lz4_chunks,
        plain_chunks,
        unchunked,
        other_chunks,
        without_summary,
        by_topic,
        shuffled,
        renumbered,
        with_foreign,
        without_sequence,
    ),
    CHANGES: (
        other_outcome,
        other_figure,
        other_run,
        other_format,
        dropped_metadata,
        dropped_channel,
        dropped_messages,
        repeated_messages,
        other_bits,
        malformed_message,
        other_times,
        other_event,
        other_schema,
        other_attachment,
        dropped_attachment,
        hungry_scenario,
        series_of_holes,
    ),
    DAMAGES: (
        flipped_bits,
        cut_off,
        cut_out,
        noise_within,
        zeros_within,
        flipped_bits_unchunked,
        bomb,
        counts,
    ),
}


def mutated(data: bytes, seed: int) -> tuple[str, str, bytes]:
    """Kind, name and bytes of the mutation with a number; every kind of it comes in turn."""
    rng = np.random.default_rng([16, seed])
    everything = [(kind, one) for kind, some in MUTATIONS.items() for one in some]
    kind, mutation = everything[seed % len(everything)]
    return kind, mutation.__name__, mutation(data, rng)


def recorded(folder: Path) -> Path:
    """A short run to mutate."""
    from sim.bridge.run import run_scenario
    from sim.scenario import load, with_values

    path = folder / "run.mcap"
    changes = {"time_limit": 0.6, "controller.horizon": 10}
    run_scenario(with_values(load("push-40N-first"), changes), log=path)
    return path

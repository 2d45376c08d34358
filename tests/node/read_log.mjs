// Reads every message of a log by its own schema and prints what it found as JSON: node read_log.mjs RUN.mcap
import { readFile } from "node:fs/promises";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";
import * as fzstd from "fzstd";
import protobuf from "protobufjs";
import descriptor from "protobufjs/ext/descriptor/index.js";

const bytes = await readFile(process.argv[2]);
const decompressHandlers = { zstd: (data, size) => fzstd.decompress(data, new Uint8Array(Number(size))) };
const readable = {
  size: async () => BigInt(bytes.length),
  read: async (offset, size) => new Uint8Array(bytes.buffer, bytes.byteOffset + Number(offset), Number(size)),
};
const found = { channels: {}, attachments: {}, metadata: [] };

const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
const types = new Map();
for (const [id, schema] of reader.schemasById) {
  const set = descriptor.FileDescriptorSet.decode(schema.data);
  types.set(id, protobuf.Root.fromDescriptor(set).lookupType(schema.name));
}
for (const channel of reader.channelsById.values()) found.channels[channel.topic] = { count: 0, metadata: [...channel.metadata.keys()].sort() };
for await (const message of reader.readMessages()) {
  const channel = reader.channelsById.get(message.channelId), entry = found.channels[channel.topic];
  const value = types.get(channel.schemaId).decode(message.data);
  entry.count += 1;
  entry.last = { tick: message.sequence, time: String(message.logTime), value: types.get(channel.schemaId).toObject(value, { longs: Number }) };
}
for await (const one of reader.readAttachments()) found.attachments[one.name] = one.data.length;
for await (const one of reader.readMetadata()) found.metadata.push(one.name);
found.statistics = String(reader.statistics.messageCount);

// The stream reader checks every chunk's CRC and the CRC of the data section.
const stream = new McapStreamReader({ decompressHandlers, validateCrcs: true });
stream.append(bytes);
found.streamed = 0;
for (let record; (record = stream.nextRecord()); ) if (record.type === "Message") found.streamed += 1;
found.done = stream.done();
console.log(JSON.stringify(found));

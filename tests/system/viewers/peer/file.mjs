// Prints the channels of a recording with what a viewer decodes: node file.mjs FILE [LICHTBLICK]
import { McapIndexedReader } from "@mcap/core";
import { loadDecompressHandlers } from "@mcap/support";
import { readFile } from "node:fs/promises";
import { decoderOf, opened, plain } from "./schemas.mjs";

const [path, lichtblick] = process.argv.slice(2);
const makeDecoder = await decoderOf(lichtblick);
const bytes = await readFile(path);
const reader = await McapIndexedReader.Initialize({
  readable: {
    size: async () => BigInt(bytes.length),
    read: async (offset, size) => new Uint8Array(
      bytes.buffer, bytes.byteOffset + Number(offset), Number(size)),
  },
  decompressHandlers: await loadDecompressHandlers(),
});
const channels = new Map();
for (const [id, channel] of reader.channelsById) {
  const schema = reader.schemasById.get(channel.schemaId);
  const one = { encoding: channel.messageEncoding, schemaName: schema?.name, schema: schema?.data };
  channels.set(id, { topic: channel.topic, ...opened(makeDecoder, one), ...one, messages: [] });
}
for await (const message of reader.readMessages()) {
  const channel = channels.get(message.channelId);
  if (channel.decode === undefined) continue;
  channel.messages.push({
    sequence: message.sequence,
    log_time_ns: message.logTime,
    publish_time_ns: message.publishTime,
    value: channel.decode(message.data),
  });
}
const list = [...channels.values()].map(({ topic, encoding, schemaName, refusal, messages }) =>
  ({ topic, encoding, schema: schemaName, refusal, messages }));
process.stdout.write(JSON.stringify(list, plain));

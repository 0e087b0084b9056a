// Prints the messages of a recording of ROS 2 as JSON, read by the code of Foxglove.
import {McapIndexedReader} from '@mcap/core';
import {loadDecompressHandlers} from '@mcap/support';
import {parse} from '@foxglove/rosmsg';
import {MessageReader} from '@foxglove/rosmsg2-serialization';
import {readFile} from 'node:fs/promises';

const bytes = await readFile(process.argv[2]);
const indexed = await McapIndexedReader.Initialize({
  readable: {
    size: async () => BigInt(bytes.length),
    read: async (offset, size) =>
      new Uint8Array(bytes.buffer, bytes.byteOffset + Number(offset), Number(size)),
  },
  decompressHandlers: await loadDecompressHandlers(),
});
const readers = new Map();
for (const channel of indexed.channelsById.values()) {
  const schema = indexed.schemasById.get(channel.schemaId);
  if (schema.encoding !== 'ros2msg' || channel.messageEncoding !== 'cdr')
    throw new Error(`${channel.topic}: ${schema.encoding}, ${channel.messageEncoding}`);
  const definitions = parse(new TextDecoder().decode(schema.data), {ros2: true});
  readers.set(channel.id, new MessageReader(definitions));
}
const plain = (key, value) =>
  typeof value === 'bigint' ? Number(value) : ArrayBuffer.isView(value) ? [...value] : value;
const messages = [];
for await (const {channelId, logTime, data} of indexed.readMessages()) {
  const channel = indexed.channelsById.get(channelId);
  messages.push({
    topic: channel.topic, type: indexed.schemasById.get(channel.schemaId).name, logTime,
    value: readers.get(channelId).readMessage(data)});
}
console.log(JSON.stringify({profile: indexed.header.profile, messages}, plain));

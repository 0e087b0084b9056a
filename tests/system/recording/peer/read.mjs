// Prints a recording as JSON, read by its index and once more from its beginning to its end.
import {McapIndexedReader, McapStreamReader} from '@mcap/core';
import {loadDecompressHandlers} from '@mcap/support';
import {open, readFile} from 'node:fs/promises';

const path = process.argv[2];
const decompressHandlers = await loadDecompressHandlers();
const file = await open(path);
const readable = {
  size: async () => BigInt((await file.stat()).size),
  read: async (offset, size) => {
    const bytes = new Uint8Array(Number(size));
    await file.read(bytes, 0, bytes.length, Number(offset));
    return bytes;
  },
};
const text = (bytes) => Buffer.from(bytes).toString('latin1');
const plain = (key, value) =>
  typeof value === 'bigint' ? Number(value) :
  value instanceof Uint8Array ? text(value) :
  value instanceof Map ? Object.fromEntries(value) : value;

const indexed = await McapIndexedReader.Initialize({readable, decompressHandlers});
const messages = [];
for await (const message of indexed.readMessages()) messages.push(message);
const metadata = [];
for await (const one of indexed.readMetadata()) metadata.push(one);
const attachments = [];
for await (const one of indexed.readAttachments()) attachments.push(one);

const stream = new McapStreamReader({decompressHandlers, validateCrcs: true});
stream.append(await readFile(path));
let streamed_count = 0;
for (let record; (record = stream.nextRecord());)
  if (record.type === 'Message') ++streamed_count;

console.log(JSON.stringify({
  library: indexed.header.library,
  schemas: [...indexed.schemasById.values()],
  channels: [...indexed.channelsById.values()],
  statistics: indexed.statistics,
  chunks: indexed.chunkIndexes.length,
  messages, metadata, attachments, streamed_count, is_done: stream.done(),
}, plain));
await file.close();

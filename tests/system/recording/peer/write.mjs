// Writes a recording: 100 messages on two channels. Usage: write.mjs FILE none|zstd|loose
import {McapWriter} from '@mcap/core';
import zstd from '@foxglove/wasm-zstd';
import {writeFile} from 'node:fs/promises';

const [path, form] = process.argv.slice(2);
await zstd.isLoaded;
const compress = form === 'zstd' && ((bytes) => zstd.compress(bytes, 3));
const parts = [];
let size = 0n;
const writer = new McapWriter({
  writable: {
    position: () => size,
    write: async (bytes) => { parts.push(Buffer.from(bytes)); size += BigInt(bytes.length); },
  },
  chunkSize: 500,
  useChunks: form !== 'loose',
  compressChunk: compress ?
    (bytes) => ({compression: form, compressedData: compress(bytes)}) : undefined,
});
await writer.start({profile: '', library: 'peer'});
const schemaId = await writer.registerSchema(
  {name: 'lab.Touched', encoding: 'jsonschema', data: Buffer.from('{"type":"object"}')});
const channelIds = [];
for (const topic of ['a', 'b'])
  channelIds.push(await writer.registerChannel(
    {schemaId, topic, messageEncoding: 'json', metadata: new Map([['unit', 'newton']])}));
for (let i = 0; i < 100; ++i)
  await writer.addMessage({
    channelId: channelIds[i % 2], sequence: i, logTime: BigInt(i + 1) * 1000n,
    publishTime: BigInt(i) * 1000n, data: Buffer.from(`{"force":${i}}`)});
await writer.addMetadata({name: 'host', metadata: new Map([['cores', '2']])});
await writer.addAttachment({
  logTime: 1n, createTime: 2n, name: 'lab.conf', mediaType: 'text/plain',
  data: Buffer.from('devices = arm0')});
await writer.end();
await writeFile(path, Buffer.concat(parts));

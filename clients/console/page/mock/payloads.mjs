// Payloads of samples and touches: recorded ones, with new numbers in their places.
import {readFileSync} from 'node:fs';

const recorded = JSON.parse(
  readFileSync(new URL('../tests/fixtures/recorded.json', import.meta.url), 'utf8'),
);

const pictures = JSON.parse(
  readFileSync(new URL('../tests/fixtures/pictures.json', import.meta.url), 'utf8'),
);

export const schemas = {...recorded.schemas, 'foxglove.CompressedImage': pictures.schema};

/** Pictures of a camera; the time of a message is that of its frame. */
export const picturePayloads = pictures.jpeg.map((one) => Buffer.from(one, 'base64'));

function templateOf(schemaName) {
  const found = recorded.messages.find((one) => one.schemaName === schemaName);
  const bytes = Buffer.from(found.payload, 'base64');
  const root = bytes.readUInt32LE(0);
  const vtable = root - bytes.readInt32LE(root);
  return {bytes, start: root + bytes.readUInt16LE(vtable + 4)};
}

const sampled = templateOf('rtpm.device.Sampled');
const touched = templateOf('rtpm.touch.Touched');

function put(bytes, at, numbers) {
  numbers.forEach((number, i) => bytes.writeDoubleLE(number, at + 8 * i));
}

export function samplePayload({
  sequence,
  time,
  position,
  force,
  orientation = [0, 0, 0, 1],
  joints = [],
  analogs = [],
}) {
  const bytes = Buffer.from(sampled.bytes);
  const at = sampled.start;
  bytes.writeBigUInt64LE(BigInt(sequence), at);
  bytes.writeBigInt64LE(BigInt(Math.round(time * 1e9)), at + 8);
  put(bytes, at + 24, position);
  put(bytes, at + 48, orientation);
  put(bytes, at + 128, force);
  put(bytes, at + 176, joints);
  analogs.forEach((number, i) => bytes.writeFloatLE(number, at + 400 + 4 * i));
  return bytes;
}

export function touchPayload({sequence, device, proxy, force, face, shape}) {
  const bytes = Buffer.from(touched.bytes);
  const at = touched.start;
  bytes.writeBigUInt64LE(BigInt(sequence), at);
  put(bytes, at + 8, device);
  put(bytes, at + 32, proxy);
  put(bytes, at + 56, force);
  put(bytes, at + 80, [face]);
  bytes.writeUInt8(shape, at + 88);
  return bytes;
}

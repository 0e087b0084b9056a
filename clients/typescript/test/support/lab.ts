import { BadValue, type Codec } from "../../src/values/codec.js";
import { nothing } from "../../src/values/codec.js";
import type { Interface, Method } from "../../src/values/method.js";

// An interface as rtpmc would generate it, for tests without it.

export const bytes: Codec<Uint8Array> = {
  encode: (value) => value,
  decode: (value) => value.slice(),
};

export const number: Codec<number> = {
  encode(value) {
    const encoded = new Uint8Array(8);
    new DataView(encoded.buffer).setFloat64(0, value, true);
    return encoded;
  },
  decode(value) {
    if (value.length !== 8) throw new BadValue(`a number has 8 bytes, not ${value.length}`);
    return new DataView(value.buffer, value.byteOffset).getFloat64(0, true);
  },
};

export const echo: Method<Uint8Array, Uint8Array> = {
  name: "echo",
  id: 1,
  kind: "call",
  request: bytes,
  reply: bytes,
  fingerprint: 1,
};
export const add: Method<number, number> = {
  name: "add",
  id: 2,
  kind: "call",
  request: number,
  reply: number,
  fingerprint: 2,
};
export const tell: Method<number, void> = {
  name: "tell",
  id: 3,
  kind: "oneway",
  request: number,
  reply: nothing,
  fingerprint: 3,
};
export const note: Method<number, void> = {
  name: "note",
  id: 4,
  kind: "receipt",
  request: number,
  reply: nothing,
  fingerprint: 4,
};
/** Counts up to the number; a negative one never ends. */
export const count: Method<number, number> = {
  name: "count",
  id: 5,
  kind: "stream",
  request: number,
  reply: number,
  fingerprint: 5,
};
export const get: Method<void, number> = {
  name: "get",
  id: 6,
  kind: "call",
  request: nothing,
  reply: number,
  fingerprint: 6,
  isIdempotent: true,
};
/** Items of that size in bytes. */
export const blocks: Method<number, Uint8Array> = {
  name: "blocks",
  id: 7,
  kind: "stream",
  request: number,
  reply: bytes,
  fingerprint: 7,
};

export const Arm: Interface = {
  name: "lab.Arm",
  fingerprint: 0x1234n,
  methods: [echo, add, tell, note, count, get, blocks],
};

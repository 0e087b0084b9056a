import { areEqual, concat, utf8, viewOf } from "./bytes.js";
import { cookieSpan } from "./numbers.js";

const mask = 0xffff_ffff_ffff_ffffn;

function rotate(value: bigint, bits: bigint): bigint {
  return ((value << bits) | (value >> (64n - bits))) & mask;
}

/** SipHash-2-4, 64 bits. */
export function sipHash(key: readonly [bigint, bigint], bytes: Uint8Array): bigint {
  const [k0, k1] = key;
  let a = k0 ^ 0x736f6d6570736575n;
  let b = k1 ^ 0x646f72616e646f6dn;
  let c = k0 ^ 0x6c7967656e657261n;
  let d = k1 ^ 0x7465646279746573n;
  const rounds = (count: number): void => {
    for (let i = 0; i < count; i += 1) {
      a = (a + b) & mask;
      c = (c + d) & mask;
      b = rotate(b, 13n) ^ a;
      d = rotate(d, 16n) ^ c;
      a = rotate(a, 32n);
      c = (c + b) & mask;
      a = (a + d) & mask;
      b = rotate(b, 17n) ^ c;
      d = rotate(d, 21n) ^ a;
      c = rotate(c, 32n);
    }
  };
  const padded = new Uint8Array((Math.floor(bytes.length / 8) + 1) * 8);
  padded.set(bytes);
  padded[padded.length - 1] = bytes.length & 0xff;
  const view = viewOf(padded);
  for (let at = 0; at < padded.length; at += 8) {
    const word = view.getBigUint64(at, true);
    d ^= word;
    rounds(2);
    a ^= word;
  }
  c ^= 0xffn;
  rounds(4);
  return a ^ b ^ c ^ d;
}

/** Gives cookies and recognises them (spec/hprotocol.md, 4.2), without keeping anything. */
export class CookieJar {
  private readonly key: readonly [bigint, bigint];

  /** @param secret  16 random bytes */
  constructor(secret: Uint8Array) {
    const view = viewOf(secret);
    this.key = [view.getBigUint64(0, true), view.getBigUint64(8, true)];
  }

  give(peer: string, clientEpoch: bigint, now: number): Uint8Array {
    return this.cookieOf(peer, clientEpoch, Math.floor(now / cookieSpan));
  }
  isGood(cookie: Uint8Array, peer: string, clientEpoch: bigint, now: number): boolean {
    const span = Math.floor(now / cookieSpan);
    return (
      areEqual(cookie, this.cookieOf(peer, clientEpoch, span)) ||
      areEqual(cookie, this.cookieOf(peer, clientEpoch, span - 1))
    );
  }

  private cookieOf(peer: string, clientEpoch: bigint, span: number): Uint8Array {
    const seed = new Uint8Array(17);
    const cookie = new Uint8Array(16);
    viewOf(seed).setBigUint64(1, clientEpoch, true);
    viewOf(seed).setFloat64(9, span, true);
    for (let half = 0; half < 2; half += 1) {
      seed[0] = half;
      const hash = sipHash(this.key, concat(seed, utf8.encode(peer)));
      viewOf(cookie).setBigUint64(8 * half, hash, true);
    }
    return cookie;
  }
}

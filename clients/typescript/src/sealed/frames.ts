import { concat, isZero, utf8, viewOf } from "../core/bytes.js";
import {
  helloSize,
  readHello,
  readWelcome,
  writeWelcome,
  type Hello,
  type Welcome,
} from "../core/handshake.js";
import { readHeader, type Header } from "../core/header.js";
import {
  Flag,
  FrameKind,
  framePayloadMax,
  headerSize,
  type DropReason,
  type Medium,
} from "../core/numbers.js";
import { Suite } from "./algorithms.js";
import { message1Size } from "./noise.js";

// Payloads and frames of sealed sessions (spec/security.md, sections 3 and 4).

/** Bits of the features in HELLO and WELCOME (sec-3-2). */
export const Feature = { sealed: 1, aesGcm: 2 } as const;
export const sealedCookieSize = 56;
export const sealedHelloSize = helloSize + message1Size;
/** The counter and the tag behind the payload. */
export const trailerSize = 24;

/** The largest payload of a sealed frame, in bytes (sec-4-3). */
export function sealedPayloadMax(medium: Medium): number {
  return framePayloadMax(medium) - trailerSize;
}

export function suiteOf(features: number): Suite {
  return (features & Feature.aesGcm) === 0 ? Suite.chaChaPoly : Suite.aesGcm;
}

function hasGoodFeatures(features: number): boolean {
  return (features & Feature.sealed) !== 0 && (features & ~(Feature.sealed | Feature.aesGcm)) === 0;
}

/** The bytes that both sides hash first (sec-3.4-1). @param cookie  the COOKIE's payload, if there was one */
export function prologueOf(
  priority: number,
  callId: number,
  hello: Uint8Array,
  cookie: Uint8Array | undefined,
): Uint8Array {
  const numbers = new Uint8Array(6);
  viewOf(numbers).setUint16(0, priority, true);
  viewOf(numbers).setUint32(2, callId, true);
  const begin = utf8.encode("H-Protocol 1.0 S");
  return concat(begin, numbers, hello, cookie ?? new Uint8Array(sealedCookieSize));
}

export interface SealedCookie {
  cookie: Uint8Array;
  serverKey: Uint8Array;
  suites: number;
}

export function writeSealedCookie(cookie: SealedCookie): Uint8Array {
  const bytes = new Uint8Array(sealedCookieSize);
  bytes.set(cookie.cookie, 0);
  bytes.set(cookie.serverKey, 16);
  viewOf(bytes).setUint32(48, cookie.suites, true);
  return bytes;
}

/** undefined if it is to be dropped as bad_payload (sec-3.1-2). */
export function readSealedCookie(payload: Uint8Array): SealedCookie | undefined {
  if (payload.length !== sealedCookieSize || !isZero(payload.subarray(52))) return undefined;
  const suites = viewOf(payload).getUint32(48, true);
  return { cookie: payload.slice(0, 16), serverKey: payload.slice(16, 48), suites };
}

/** undefined if it is to be dropped as bad_payload (sec-3.2-1). */
export function readSealedHello(
  payload: Uint8Array,
): { hello: Hello; message: Uint8Array } | undefined {
  if (payload.length !== sealedHelloSize) return undefined;
  const hello = readHello(payload.subarray(0, helloSize));
  if (hello === undefined || !hasGoodFeatures(hello.features)) return undefined;
  return { hello, message: payload.slice(helloSize) };
}

/** The fate of the session that message 1 named (sec-3.3). */
export const Former = { none: 0, alive: 1, gone: 2, ended: 3 } as const;

/** The content of message 2. */
export interface SealedWelcome {
  session: bigint;
  welcome: Welcome;
  former: number;
}

export function writeSealedWelcome(inside: SealedWelcome): Uint8Array {
  const bytes = new Uint8Array(64);
  viewOf(bytes).setBigUint64(0, inside.session, true);
  bytes.set(writeWelcome(inside.welcome), 8);
  bytes[56] = inside.former;
  return bytes;
}

/** undefined if it is to be dropped as bad_payload (sec-3.3-1). @param features  of the HELLO */
export function readSealedWelcome(bytes: Uint8Array, features: number): SealedWelcome | undefined {
  if (bytes.length !== 64) return undefined;
  const session = viewOf(bytes).getBigUint64(0, true);
  const welcome = readWelcome(bytes.subarray(8, 56), features);
  const former = bytes[56]!;
  const isGood =
    welcome !== undefined &&
    hasGoodFeatures(welcome.features) &&
    welcome.features === features &&
    session !== 0n &&
    former <= Former.ended &&
    isZero(bytes.subarray(57));
  return isGood ? { session, welcome, former } : undefined;
}

export function isSealed(frame: Uint8Array): boolean {
  return frame.length >= headerSize && (viewOf(frame).getUint16(6, true) & Flag.sealed) !== 0;
}

function setSealed(frame: Uint8Array, isSet: boolean): void {
  const view = viewOf(frame);
  const flags = view.getUint16(6, true);
  view.setUint16(6, isSet ? flags | Flag.sealed : flags & ~Flag.sealed, true);
}

/** The header as sent in a sealed frame: a copy with the flag. */
export function sealedHeader(frame: Uint8Array): Uint8Array {
  const header = frame.slice(0, headerSize);
  setSealed(header, true);
  return header;
}

/** A sealed frame without its trailer and flag, around its opened payload. */
export function unsealedFrame(frame: Uint8Array, payload: Uint8Array): Uint8Array {
  const plain = concat(frame.subarray(0, headerSize), payload);
  setSealed(plain, false);
  return plain;
}

/** Checks a sealed frame up to its seal (sec-4-2). */
export function readSealedFrame(frame: Uint8Array, medium: Medium): Header | DropReason {
  if (frame.length < headerSize) return "too_short";
  const copy = frame.slice(0, headerSize);
  setSealed(copy, false);
  const header = readHeader(copy);
  if (typeof header === "string") return header;
  if (!isSealed(frame)) return "unsealed";
  const { HELLO, COOKIE, WELCOME } = FrameKind;
  if (([HELLO, COOKIE, WELCOME] as number[]).includes(header.kind)) return "reserved_set";
  const isWhole = header.payloadSize + trailerSize === frame.length - headerSize;
  return isWhole && header.payloadSize <= sealedPayloadMax(medium) ? header : "bad_length";
}

/**
 * The size of the frame that begins here on a stream, from its first 64 bytes; the reason if they
 * are no header (hp-8-2).
 * @param takesSealed  whether the receiver has level S, so that the flag *sealed* is not reserved
 */
export function frameSizeOf(
  bytes: Uint8Array,
  medium: Medium,
  takesSealed: boolean,
): number | DropReason {
  const copy = bytes.slice(0, headerSize);
  if (isSealed(copy) && !takesSealed) return "reserved_set";
  const trailer = isSealed(copy) ? trailerSize : 0;
  setSealed(copy, false);
  const header = readHeader(copy);
  if (typeof header === "string") return header;
  if (header.payloadSize + trailer > framePayloadMax(medium)) return "bad_length";
  return headerSize + header.payloadSize + trailer;
}

import { isZero, viewOf } from "./bytes.js";
import {
  messageSizeCeiling,
  messageSizeFloor,
  priorityHighest,
  protocolVersion,
} from "./numbers.js";
import type { Band } from "./numbers.js";

export const helloSize = 64;
export const cookieSize = 16;
export const welcomeSize = 48;

/** The payload of HELLO (spec/hprotocol.md, 4.1). */
export interface Hello {
  versionMin: number;
  versionMax: number;
  features: number;
  clientEpoch: bigint;
  channel: bigint;
  clockDomain: bigint;
  messageSizeMax: number;
  cookie: Uint8Array;
}

export function writeHello(hello: Hello): Uint8Array {
  const bytes = new Uint8Array(helloSize);
  const view = viewOf(bytes);
  view.setUint16(0, hello.versionMin, true);
  view.setUint16(2, hello.versionMax, true);
  view.setUint32(4, hello.features, true);
  view.setBigUint64(8, hello.clientEpoch, true);
  view.setBigUint64(16, hello.channel, true);
  view.setBigUint64(24, hello.clockDomain, true);
  view.setUint32(32, hello.messageSizeMax, true);
  bytes.set(hello.cookie, 40);
  return bytes;
}

/** undefined if it is to be dropped as bad_payload (hp-4.1-1). */
export function readHello(payload: Uint8Array): Hello | undefined {
  if (payload.length !== helloSize) return undefined;
  const view = viewOf(payload);
  const clientEpoch = view.getBigUint64(8, true);
  const isReservedZero = view.getUint32(36, true) === 0 && view.getBigUint64(56, true) === 0n;
  if (!isReservedZero || clientEpoch === 0n) return undefined;
  return {
    versionMin: view.getUint16(0, true),
    versionMax: view.getUint16(2, true),
    features: view.getUint32(4, true),
    clientEpoch,
    channel: view.getBigUint64(16, true),
    clockDomain: view.getBigUint64(24, true),
    messageSizeMax: view.getUint32(32, true),
    cookie: payload.slice(40, 56),
  };
}

/** The payload of WELCOME (spec/hprotocol.md, 4.3). */
export interface Welcome {
  band: Band;
  ceiling: number;
  features: number;
  window: number;
  serverEpoch: bigint;
  clockDomain: bigint;
  messageSizeMax: number;
}

export function writeWelcome(welcome: Welcome): Uint8Array {
  const bytes = new Uint8Array(welcomeSize);
  const view = viewOf(bytes);
  view.setUint16(0, protocolVersion, true);
  view.setUint16(2, welcome.band.low, true);
  view.setUint16(4, welcome.band.high, true);
  view.setUint16(6, welcome.ceiling, true);
  view.setUint32(8, welcome.features, true);
  view.setUint16(12, welcome.window, true);
  view.setBigUint64(16, welcome.serverEpoch, true);
  view.setBigUint64(24, welcome.clockDomain, true);
  view.setUint32(32, welcome.messageSizeMax, true);
  return bytes;
}

/**
 * undefined if it is to be dropped as bad_payload (hp-4.3-1); session and priority are the caller's
 * to check.
 * @param features  the bits that the client offered
 */
export function readWelcome(payload: Uint8Array, features = 0): Welcome | undefined {
  if (payload.length !== welcomeSize) return undefined;
  const view = viewOf(payload);
  const welcome: Welcome = {
    band: { low: view.getUint16(2, true), high: view.getUint16(4, true) },
    ceiling: view.getUint16(6, true),
    features: view.getUint32(8, true),
    window: view.getUint16(12, true),
    serverEpoch: view.getBigUint64(16, true),
    clockDomain: view.getBigUint64(24, true),
    messageSizeMax: view.getUint32(32, true),
  };
  const { low, high } = welcome.band;
  const isGood =
    view.getUint16(0, true) === protocolVersion &&
    low <= high &&
    high <= priorityHighest &&
    welcome.ceiling <= priorityHighest &&
    (welcome.features & ~features) === 0 &&
    welcome.window !== 0 &&
    (welcome.window & (welcome.window - 1)) === 0 &&
    view.getUint16(14, true) === 0 &&
    welcome.serverEpoch !== 0n &&
    isAllowedMessageSize(welcome.messageSizeMax) &&
    isZero(payload.subarray(36));
  return isGood ? welcome : undefined;
}

export function isAllowedMessageSize(size: number): boolean {
  return size >= messageSizeFloor && size <= messageSizeCeiling;
}

import { viewOf } from "../core/bytes.js";
import { priorityHighest } from "../core/numbers.js";
import { BadValue } from "../values/codec.js";
import type { EventType } from "../values/method.js";

const headerSize = 64;
const alignment = 16;
const replayedFlag = 1;
const joinedFlag = 2;
// How many hubs an event of this program may cross.
const hops = 8;

/** An event as a hub delivers it (ev-2). Times are nanoseconds of the hub's monotonic clock. */
export class HubEvent {
  /** 1 to 2^31-1; larger ones are the hub's own. */
  readonly type: number;
  /** Tells the suppliers of one type apart. */
  readonly source: number;
  /** Counts the events of one supplier, type and source, from 1; 0n: not counted. */
  readonly sequence: bigint;
  /** When it happened. */
  readonly originNs: bigint;
  /** When the hub took it up, */
  readonly receivedNs: bigint;
  /** and when it sent it on. */
  readonly sentNs: bigint;
  /** The fingerprint of the payload's schema; 0n: none. */
  readonly schemaId: bigint;
  /** How far originNs may be off; 2^32-1: unknown. */
  readonly uncertaintyNs: number;
  /** The supplier's. */
  readonly priority: number;
  /** It is older than the subscription. */
  readonly isReplayed: boolean;
  /** The next event belongs to the same delivery, as a filter correlated them. */
  readonly isJoined: boolean;
  readonly payload: Uint8Array;

  /** @param bytes  a header and its payload, which were checked @internal */
  constructor(bytes: Uint8Array) {
    const view = viewOf(bytes);
    this.type = view.getUint32(0, true);
    this.source = view.getUint32(4, true);
    this.sequence = view.getBigUint64(8, true);
    this.originNs = view.getBigInt64(16, true);
    this.receivedNs = view.getBigInt64(24, true);
    this.sentNs = view.getBigInt64(32, true);
    this.schemaId = view.getBigUint64(40, true);
    this.uncertaintyNs = view.getUint32(52, true);
    this.priority = view.getUint16(56, true);
    this.isReplayed = (bytes[59]! & replayedFlag) !== 0;
    this.isJoined = (bytes[59]! & joinedFlag) !== 0;
    this.payload = bytes.subarray(headerSize);
  }

  /** Whether the event has this type and schema. */
  is<T>(type: EventType<T>): boolean {
    return this.type === type.type && this.schemaId === type.schemaId;
  }

  /** The event's value. @throws BadValue if it has another type or schema, or is malformed */
  value<T>(type: EventType<T>): T {
    if (!this.is(type)) throw new BadValue(`an event of another type or schema than ${type.name}`);
    return type.codec.decode(this.payload);
  }
}

function isGood(bytes: Uint8Array, view: DataView, at: number): boolean {
  return (
    view.getUint32(at, true) !== 0 &&
    view.getUint16(at + 56, true) <= priorityHighest &&
    (bytes[at + 59]! & ~(replayedFlag | joinedFlag)) === 0 &&
    view.getUint32(at + 48, true) <= bytes.length - at - headerSize
  );
}

/** The events, and whether the bytes behind the last one are malformed (ev-2-1). */
export function readEvents(bytes: Uint8Array): { events: HubEvent[]; isBroken: boolean } {
  const view = viewOf(bytes);
  const events: HubEvent[] = [];
  for (let at = 0; at < bytes.length;) {
    if (bytes.length - at < headerSize || !isGood(bytes, view, at)) {
      return { events, isBroken: true };
    }
    const size = headerSize + view.getUint32(at + 48, true);
    events.push(new HubEvent(bytes.subarray(at, at + size)));
    at += size + padding(size);
  }
  return { events, isBroken: false };
}

/** A supplier states this of an event. */
export interface EventHead {
  readonly type: number;
  readonly source: number;
  readonly sequence: bigint;
  readonly originNs: bigint;
  readonly uncertaintyNs: number;
  readonly schemaId: bigint;
}

/** One event of a supplier. */
export function writeEvent(head: EventHead, payload: Uint8Array): Uint8Array {
  const size = headerSize + payload.length;
  const bytes = new Uint8Array(size + padding(size));
  const view = viewOf(bytes);
  view.setUint32(0, head.type, true);
  view.setUint32(4, head.source, true);
  view.setBigUint64(8, head.sequence, true);
  view.setBigInt64(16, head.originNs, true);
  view.setBigUint64(40, head.schemaId, true);
  view.setUint32(48, payload.length, true);
  view.setUint32(52, Math.min(head.uncertaintyNs, 0xffff_ffff), true);
  bytes[58] = hops;
  bytes.set(payload, headerSize);
  return bytes;
}

function padding(size: number): number {
  return (alignment - (size % alignment)) % alignment;
}

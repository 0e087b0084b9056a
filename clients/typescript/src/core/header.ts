import { viewOf, wrap } from "./bytes.js";
import {
  Flag,
  FrameKind,
  fragmentCountMax,
  frameKindLast,
  framePayloadMax,
  headerSize,
  messageSizeCeiling,
  priorityHighest,
  protocolVersion,
  type DropReason,
  type Medium,
} from "./numbers.js";

/** The fields of a frame's first 64 bytes (spec/hprotocol.md, section 2). */
export interface Header {
  kind: FrameKind;
  priority: number;
  flags: number;
  session: bigint;
  callId: number;
  service: number;
  method: number;
  status: number;
  payloadSize: number;
  fragmentIndex: number;
  fragmentCount: number;
  messageSize: number;
  budgetUs: number;
  item: number;
  senderTimeNs: bigint;
  traceId: bigint;
}

const magic = 0x5048; // "HP" in reading order
const flagsKnown = Flag.repeated | Flag.ackWanted | Flag.noReply | Flag.replyOnReceipt;
const flagsOneway = Flag.noReply | Flag.replyOnReceipt;

/** A header of one whole frame; fields without meaning are 0 (hp-2-7). */
export function newHeader(kind: FrameKind, priority: number, payloadSize: number): Header {
  return {
    kind,
    priority,
    flags: 0,
    session: 0n,
    callId: 0,
    service: 0,
    method: 0,
    status: 0,
    payloadSize,
    fragmentIndex: 0,
    fragmentCount: 1,
    messageSize: payloadSize,
    budgetUs: 0,
    item: 0,
    senderTimeNs: 0n,
    traceId: 0n,
  };
}

/** A header of another kind about the same call. */
export function headerAbout(
  about: Header,
  kind: FrameKind,
  payloadSize: number,
  now: number,
): Header {
  const header = newHeader(kind, about.priority, payloadSize);
  header.session = about.session;
  header.callId = about.callId;
  header.service = about.service;
  header.method = about.method;
  header.senderTimeNs = BigInt(Math.trunc(now));
  header.traceId = about.traceId;
  return header;
}

/** Writes the header to the first 64 bytes of `to`. */
export function writeHeader(header: Header, to: Uint8Array): void {
  const view = viewOf(to);
  view.setUint16(0, magic, true);
  view.setUint8(2, protocolVersion);
  view.setUint8(3, header.kind);
  view.setUint16(4, header.priority, true);
  view.setUint16(6, header.flags, true);
  view.setBigUint64(8, header.session, true);
  view.setUint32(16, header.callId, true);
  view.setUint32(20, header.service, true);
  view.setUint16(24, header.method, true);
  view.setUint16(26, header.status, true);
  view.setUint32(28, header.payloadSize, true);
  view.setUint16(32, header.fragmentIndex, true);
  view.setUint16(34, header.fragmentCount, true);
  view.setUint32(36, header.messageSize, true);
  view.setUint32(40, wrap(header.budgetUs), true);
  view.setUint32(44, wrap(header.item), true);
  view.setBigUint64(48, header.senderTimeNs, true);
  view.setBigUint64(56, header.traceId, true);
}

/** A new frame of header and payload. */
export function frameOf(header: Header, payload?: Uint8Array): Uint8Array {
  const frame = new Uint8Array(headerSize + (payload?.length ?? 0));
  writeHeader(header, frame);
  if (payload !== undefined) frame.set(payload, headerSize);
  return frame;
}

/** Sets the flags of a kept frame to *repeated* alone, as for a copy. */
export function markRepeated(frame: Uint8Array): void {
  viewOf(frame).setUint16(6, Flag.repeated, true);
}

// hp-2-5: flags and items that a kind does not use are reserved.
function hasGoodFlags(header: Header): boolean {
  if ((header.flags & ~flagsKnown) !== 0) return false;
  const oneway = header.flags & flagsOneway;
  switch (header.kind) {
    case FrameKind.CALL:
      return oneway === 0 || (oneway !== flagsOneway && header.item === 0);
    case FrameKind.REPLY:
    case FrameKind.ACK:
    case FrameKind.ITEM:
    case FrameKind.CREDIT:
      return oneway === 0;
    default:
      return oneway === 0 && header.item === 0;
  }
}

/**
 * The payload of every fragment but the last (hp-5.6-1), in bytes; 0 if the fields contradict each
 * other.
 */
export function fragmentSizeOf(header: Header): number {
  const count = header.fragmentCount;
  if (
    count < 2 ||
    count > fragmentCountMax ||
    header.fragmentIndex >= count ||
    header.payloadSize === 0 ||
    header.payloadSize >= header.messageSize
  ) {
    return 0;
  }
  const isLast = header.fragmentIndex === count - 1;
  const beforeLast = header.messageSize - header.payloadSize;
  if (isLast && beforeLast % (count - 1) !== 0) return 0;
  const size = isLast ? beforeLast / (count - 1) : header.payloadSize;
  const capacity = size * count;
  return capacity >= header.messageSize && capacity - size < header.messageSize ? size : 0;
}

// hp-2-4
function hasGoodFragments(header: Header): boolean {
  if (header.fragmentCount === 1) {
    return header.fragmentIndex === 0 && header.messageSize === header.payloadSize;
  }
  const mayBeLarge =
    header.kind === FrameKind.CALL ||
    header.kind === FrameKind.REPLY ||
    header.kind === FrameKind.ITEM;
  return (
    mayBeLarge &&
    (header.flags & Flag.noReply) === 0 && // hp-5.8-2
    header.messageSize <= messageSizeCeiling &&
    fragmentSizeOf(header) !== 0
  );
}

/** Reads a header in the order of hp-2-1; the reason of the first fault instead. */
export function readHeader(bytes: Uint8Array): Header | DropReason {
  if (bytes.length < headerSize) return "too_short";
  const view = viewOf(bytes);
  if (view.getUint16(0, true) !== magic) return "bad_magic";
  if (view.getUint8(2) !== protocolVersion) return "bad_version";
  const kind = view.getUint8(3);
  if (kind === 0 || kind > frameKindLast) return "bad_kind";
  const priority = view.getUint16(4, true);
  if (priority > priorityHighest) return "bad_priority";
  const header: Header = {
    kind: kind as FrameKind,
    priority,
    flags: view.getUint16(6, true),
    session: view.getBigUint64(8, true),
    callId: view.getUint32(16, true),
    service: view.getUint32(20, true),
    method: view.getUint16(24, true),
    status: view.getUint16(26, true),
    payloadSize: view.getUint32(28, true),
    fragmentIndex: view.getUint16(32, true),
    fragmentCount: view.getUint16(34, true),
    messageSize: view.getUint32(36, true),
    budgetUs: view.getUint32(40, true),
    item: view.getUint32(44, true),
    senderTimeNs: view.getBigUint64(48, true),
    traceId: view.getBigUint64(56, true),
  };
  if (!hasGoodFlags(header)) return "reserved_set";
  if (header.payloadSize > messageSizeCeiling) return "bad_length";
  if (!hasGoodFragments(header)) return "bad_fragment";
  return header;
}

/** Reads the header of one whole frame, and checks its size (hp-2-3, hp-2-6, hp-8-2). */
export function readFrame(frame: Uint8Array, medium: Medium): Header | DropReason {
  const header = readHeader(frame);
  if (typeof header === "string") return header;
  const isWhole = header.payloadSize === frame.length - headerSize;
  return isWhole && header.payloadSize <= framePayloadMax(medium) ? header : "bad_length";
}

import { concat, utf8, viewOf } from "./bytes.js";
import { pathSizeMax, priorityHighest, sessionService } from "./numbers.js";

// Payloads of the session's own service (spec/hprotocol.md, section 6), of ACK and of CREDIT.

const bindReplySize = 24;
const methodEntrySize = 8;

/** The request of a bind (spec/hprotocol.md, 6.1). */
export interface BindRequest {
  fingerprint: bigint;
  path: string;
  interfaceName: string;
}

function writeText(text: string): Uint8Array {
  const bytes = utf8.encode(text);
  const size = new Uint8Array(2);
  viewOf(size).setUint16(0, bytes.length, true);
  return concat(size, bytes);
}

/** Reads a text at `at`; undefined if it goes beyond the end. */
export function readText(
  bytes: Uint8Array,
  at: number,
): { text: string; size: number; end: number } | undefined {
  if (at + 2 > bytes.length) return undefined;
  const size = viewOf(bytes).getUint16(at, true);
  const end = at + 2 + size;
  return end > bytes.length
    ? undefined
    : { text: utf8.decode(bytes.subarray(at + 2, end)), size, end };
}

/** Texts one behind the other, as the payload of no_such_object has them. */
export function writeTexts(texts: readonly string[]): Uint8Array {
  return concat(...texts.map(writeText));
}

export function writeBindRequest(request: BindRequest): Uint8Array {
  const fingerprint = new Uint8Array(8);
  viewOf(fingerprint).setBigUint64(0, request.fingerprint, true);
  return concat(fingerprint, writeText(request.path), writeText(request.interfaceName));
}

export function readBindRequest(payload: Uint8Array): BindRequest | undefined {
  if (payload.length < 8) return undefined;
  const path = readText(payload, 8);
  const name = path === undefined ? undefined : readText(payload, path.end);
  if (path === undefined || name === undefined) return undefined;
  if (path.size > pathSizeMax || name.end !== payload.length) return undefined;
  return {
    fingerprint: viewOf(payload).getBigUint64(0, true),
    path: path.text,
    interfaceName: name.text,
  };
}

export interface MethodEntry {
  id: number;
  fingerprint: number;
}

/** The reply of a bind. */
export interface BindReply {
  service: number;
  priority: number;
  isServerDeclared: boolean;
  isMethodListComplete: boolean;
  fingerprint: bigint;
  methods: readonly MethodEntry[];
}

export function writeBindReply(reply: BindReply): Uint8Array {
  const bytes = new Uint8Array(bindReplySize + reply.methods.length * methodEntrySize);
  const view = viewOf(bytes);
  view.setUint32(0, reply.service, true);
  view.setUint16(4, reply.priority, true);
  view.setUint8(6, (reply.isServerDeclared ? 1 : 0) | (reply.isMethodListComplete ? 2 : 0));
  view.setBigUint64(8, reply.fingerprint, true);
  view.setUint16(16, reply.methods.length, true);
  reply.methods.forEach((method, i) => {
    view.setUint16(bindReplySize + i * methodEntrySize, method.id, true);
    view.setUint32(bindReplySize + i * methodEntrySize + 4, method.fingerprint, true);
  });
  return bytes;
}

/** undefined if a client may not take it (hp-6.1-5). */
export function readBindReply(payload: Uint8Array): BindReply | undefined {
  if (payload.length < bindReplySize) return undefined;
  const view = viewOf(payload);
  const flags = view.getUint8(6);
  const count = view.getUint16(16, true);
  const isGood =
    view.getUint32(0, true) !== sessionService &&
    view.getUint16(4, true) <= priorityHighest &&
    flags <= 3 &&
    view.getUint8(7) === 0 &&
    view.getUint16(18, true) === 0 &&
    view.getUint32(20, true) === 0 &&
    payload.length === bindReplySize + count * methodEntrySize;
  if (!isGood) return undefined;
  const methods: MethodEntry[] = [];
  for (let at = bindReplySize; at < payload.length; at += methodEntrySize) {
    if (view.getUint16(at + 2, true) !== 0) return undefined;
    methods.push({ id: view.getUint16(at, true), fingerprint: view.getUint32(at + 4, true) });
  }
  return {
    service: view.getUint32(0, true),
    priority: view.getUint16(4, true),
    isServerDeclared: (flags & 1) !== 0,
    isMethodListComplete: (flags & 2) !== 0,
    fingerprint: view.getBigUint64(8, true),
    methods,
  };
}

export function writeDescribeRequest(service: number): Uint8Array {
  const bytes = new Uint8Array(4);
  viewOf(bytes).setUint32(0, service, true);
  return bytes;
}

/** undefined for another size (hp-6.3-1). */
export function readDescribeRequest(payload: Uint8Array): number | undefined {
  return payload.length === 4 ? viewOf(payload).getUint32(0, true) : undefined;
}

/** The payload of ACK: the fragments that are there (spec/hprotocol.md, 5.6). */
export interface FragmentAck {
  firstMissing: number;
  /** 32 bytes; bit i: fragment firstMissing + 1 + i is there. */
  later: Uint8Array;
}

export const ackSize = 40;
export const ackLaterCount = 256;

export function writeAck(ack: FragmentAck): Uint8Array {
  const bytes = new Uint8Array(ackSize);
  viewOf(bytes).setUint16(0, ack.firstMissing, true);
  bytes.set(ack.later, 8);
  return bytes;
}

export function readAck(payload: Uint8Array): FragmentAck | undefined {
  if (payload.length !== ackSize) return undefined;
  const view = viewOf(payload);
  if (view.getUint16(2, true) !== 0 || view.getUint32(4, true) !== 0) return undefined;
  return { firstMissing: view.getUint16(0, true), later: payload.slice(8) };
}

/** The payload of CREDIT: the frames that are there, and the bytes that may come (5.10). */
export interface StreamCredit {
  firstMissing: number;
  byteLimit: number;
  /** Bit i: frame firstMissing + 1 + i is there. */
  later: bigint;
}

export function writeCredit(credit: StreamCredit): Uint8Array {
  const bytes = new Uint8Array(16);
  const view = viewOf(bytes);
  view.setUint32(0, credit.firstMissing, true);
  view.setUint32(4, credit.byteLimit, true);
  view.setBigUint64(8, credit.later, true);
  return bytes;
}

export function readCredit(payload: Uint8Array): StreamCredit | undefined {
  if (payload.length !== 16) return undefined;
  const view = viewOf(payload);
  return {
    firstMissing: view.getUint32(0, true),
    byteLimit: view.getUint32(4, true),
    later: view.getBigUint64(8, true),
  };
}

// All numbers of the protocol (spec/hprotocol.md, sections 2, 3, 7, 8 and 9).

export const protocolVersion = 1;
export const headerSize = 64;

/** Kinds of frame (spec/hprotocol.md, section 3). */
export const FrameKind = {
  HELLO: 1,
  COOKIE: 2,
  WELCOME: 3,
  REFUSE: 4,
  CALL: 5,
  REPLY: 6,
  CLOSE: 7,
  ACK: 8,
  CANCEL: 9,
  ITEM: 10,
  CREDIT: 11,
} as const;
export type FrameKind = (typeof FrameKind)[keyof typeof FrameKind];
export const frameKindLast = FrameKind.CREDIT;

/** Flags of the header (spec/hprotocol.md, section 2). */
export const Flag = {
  repeated: 1,
  ackWanted: 2,
  noReply: 4,
  replyOnReceipt: 8,
  /** Marks frames of sealed sessions; no frame that the core handles has it. */
  sealed: 16,
} as const;

/** How a call or a handshake ended (spec/hprotocol.md, section 7). */
export const Status = {
  ok: 0,
  overload: 1,
  expired: 2,
  no_such_method: 3,
  no_such_object: 4,
  bad_request: 5,
  not_lease_holder: 6,
  gone: 7,
  servant_failed: 8,
  too_large: 9,
  priority_not_allowed: 10,
  wrong_band: 11,
  unknown_session: 12,
  version_unsupported: 13,
  bad_limits: 14,
  wrong_interface: 15,
  cancelled: 16,
  stopping: 17,
  lost: 18,
  not_allowed: 19,
} as const;
export type StatusName = keyof typeof Status;

const statusNames = Object.keys(Status) as StatusName[];

/** The name of a status; `unknown` for a number that section 7 does not list. */
export function statusName(status: number): StatusName | "unknown" {
  return statusNames[status] ?? "unknown";
}

/** Why a frame is dropped (spec/hprotocol.md, section 8; spec/security.md). */
export type DropReason =
  | "too_short"
  | "bad_magic"
  | "bad_version"
  | "bad_kind"
  | "reserved_set"
  | "bad_priority"
  | "bad_length"
  | "bad_fragment"
  | "bad_payload"
  | "bad_cookie"
  | "unknown_session"
  | "foreign_address"
  | "stale_call"
  | "duplicate_running"
  | "unexpected"
  | "rate_limited"
  | "unsealed"
  | "bad_seal"
  | "replayed";

/** `datagram` is UDP; `stream` is TCP, or any other way that loses nothing and keeps order. */
export type Medium = "datagram" | "stream";

/** Priorities from `low` to `high`, both included. */
export interface Band {
  readonly low: number;
  readonly high: number;
}

export const priorityHighest = 32767;
export const allPriorities: Band = { low: 0, high: priorityHighest };

/** Whether the band contains the priority. */
export function contains(band: Band, priority: number): boolean {
  return band.low <= priority && priority <= band.high;
}

export const datagramFrameSizeMax = 1408;
export const datagramPayloadSizeMax = datagramFrameSizeMax - headerSize;
export const streamFrameSizeMax = 64 * 1024;
export const streamPayloadSizeMax = streamFrameSizeMax - headerSize;

/** The largest payload of a frame, in bytes. */
export function framePayloadMax(medium: Medium): number {
  return medium === "datagram" ? datagramPayloadSizeMax : streamPayloadSizeMax;
}

/** The range of the largest message that a side may state, in bytes. */
export const messageSizeFloor = 1024;
export const messageSizeCeiling = 16 * 1024 * 1024;

/** How many calls of a session may be open at a time. */
export const callWindow = 8;

/** How many fragments of a message may be unacknowledged (hp-5.6-2). */
export function fragmentWindow(medium: Medium): number {
  return medium === "datagram" ? 32 : 4;
}
export const fragmentCountMax = 12544;
/** How many items a client takes at a time, and how many datagrams of a stream are in flight. */
export const streamWindowMax = 32;

/** How many bytes of items a server may send before the first CREDIT (hp-5.10-9). */
export function streamBytesFirst(medium: Medium): number {
  return medium === "datagram" ? 32 * datagramPayloadSizeMax : streamPayloadSizeMax;
}

export const pathSizeMax = 200;
export const defaultPort = 7420;
export const sessionService = 0;
/** The methods of the session's own service (spec/hprotocol.md, section 6). */
export const SessionMethod = { bind: 1, ping: 2, describe: 3 } as const;

/** A stream's budget that means as long as the connection lasts (hp-5.10-7). */
export const budgetUnlimited = 0xffff_ffff;

// Times of the core are numbers of nanoseconds of a monotonic clock. A double holds them exactly
// for the first 104 days after the clock's start, and to a few nanoseconds afterwards.
export const never = Infinity;
export const microsecond = 1e3;
export const millisecond = 1e6;
export const second = 1e9;

/** A session may only be replaced after this time of silence (hp-5.5-1). */
export const sessionIdleMin = 30 * second;
/** A cookie is good for one to two spans. */
export const cookieSpan = 10 * second;
/** When an unfinished large message may be evicted (hp-5.6-10). */
export const largeMessageSilenceMax = 3 * second;
/** How long a stream's client keeps asking without an answer. */
export const streamSilence = 3 * second;
/** How long a server keeps a stream over datagrams without hearing of its client: as stated. */
export const streamLease = 10 * second;
/** The longest such time that a server grants over datagrams (hp-5.10-7). */
export const streamLeaseMax = 30 * second;
/** The longest time between a stream's questions (hp-5.10-5). */
export const streamAskIntervalMax = 500 * millisecond;
/** The earliest question behind an item on a stream medium. */
export const streamAskIntervalConnected = 100 * millisecond;
/** Repetition of calls (hp-5.3-1). */
export const copyIntervalFirst = 5 * millisecond;
export const copyIntervalMin = 500 * microsecond;
export const copyIntervalOnHost = 30 * millisecond;
export const copyIntervalMax = second;

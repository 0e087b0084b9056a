import { printable, utf8 } from "../core/bytes.js";
import { Status, statusName, type StatusName } from "../core/numbers.js";

/**
 * Why a call failed: a status of the protocol, or one of the client's own.
 *
 * `timeout`: its deadline passed. `unreachable`: no server answered. `disconnected`: the connection
 * ended. `closed`: the server closed the session. `restarted`: the server lost the session, and the
 * call may have run. `interface_mismatch`: the object has another interface. `bad_reply`: the reply
 * is no value of its type.
 */
export type CallErrorCode =
  | Exclude<StatusName, "ok">
  | "unknown"
  | "timeout"
  | "unreachable"
  | "disconnected"
  | "closed"
  | "restarted"
  | "interface_mismatch"
  | "bad_reply";

// Section 7: whether a call with this status ran; undefined: perhaps.
const ran = new Set<CallErrorCode>(["servant_failed", "bad_reply"]);
const perhapsRan = new Set<CallErrorCode>([
  "unknown",
  "timeout",
  "disconnected",
  "closed",
  "restarted",
  "cancelled",
  "stopping",
  "lost",
  "too_large",
]);

/** A call that failed. */
export class CallError extends Error {
  override readonly name = "CallError";
  /** Whether the method ran: false means that it certainly did not, undefined that it may have. */
  readonly wasRun: boolean | undefined;

  constructor(
    readonly code: CallErrorCode,
    /** "lab/arm0.setForce" */
    readonly target: string,
    detail: string,
    wasRun?: boolean,
  ) {
    super(`${target}: ${detail}`);
    this.wasRun = wasRun ?? (ran.has(code) ? true : perhapsRan.has(code) ? undefined : false);
  }
}

const remedies: Partial<Record<CallErrorCode, string>> = {
  overload: "the server is full; it did not run. Try again after a pause",
  expired: "the deadline passed before the server began it; it did not run",
  no_such_method: "the object has no such method",
  no_such_object: "the server has no such object",
  not_lease_holder: "somebody else holds the lease that the method needs",
  gone: "what the method works on was taken away",
  priority_not_allowed: "the priority is above the session's ceiling",
  wrong_band: "the priority is outside the bands that the object takes",
  stopping: "the server stops",
  not_allowed: "this client's key may not do that",
  lost: "the server did not hear of this client for too long",
};

/** The error for a status of the server, with its text (hp-7-1) if it has one. */
export function errorOfStatus(status: number, payload: Uint8Array, target: string): CallError {
  const name = statusName(status);
  const code = name === "ok" ? "unknown" : name;
  const hasText = status === Status.bad_request || status === Status.servant_failed;
  const text = hasText && payload.length > 0 ? printable(utf8.decode(payload)) : undefined;
  const about = name === "unknown" ? `unknown status ${status}` : name;
  const detail = text ?? remedies[code];
  return new CallError(code, target, detail === undefined ? about : `${about}: ${detail}`);
}

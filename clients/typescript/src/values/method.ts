import type { Codec } from "./codec.js";

/**
 * How a method is called (spec/hprotocol.md, 5.8 and 5.10).
 *
 * `call`: the caller gets a reply; also `rtpm_oneway: "done"`, whose reply is empty. `oneway`:
 * `rtpm_oneway: "sent"`, flag *no reply*, the request fits one frame. `receipt`: `rtpm_oneway:
 * "received"`, flag *reply on receipt*. `stream`: any number of items, then the end.
 */
export type Kind = "call" | "oneway" | "receipt" | "stream";

/** The role that a caller needs; each includes the previous ones (spec/hprotocol.md, 6.4). */
export type Role = "observe" | "command" | "configure" | "administer";

/**
 * One operation of an interface, as generated code describes it.
 * Q and R are void where the schema has rtpm.Empty; R is the type of a stream's items.
 */
export interface Method<Q, R> {
  /** The name in the schema, also where TypeScript's differs. */
  readonly name: string;
  /** `rtpm_id`, 1 to 65535. */
  readonly id: number;
  readonly kind: Kind;
  /** Decoding also checks the request's ranges. */
  readonly request: Codec<Q>;
  readonly reply: Codec<R>;
  /** 32 bits of everything that both sides must agree on (hp-12.1). */
  readonly fingerprint?: number;
  /** Running it twice does no harm, so a client may repeat it at a new server. */
  readonly isIdempotent?: boolean;
  /** The caller's default deadline in ms, may be fractional; the node's if absent. */
  readonly deadlineMs?: number;
  /** `command` if absent. */
  readonly role?: Role;
  /** The largest request or reply in bytes; the session's limit if absent. */
  readonly maxSize?: number;
}

// A list has methods of any types: Method is invariant, so unknown would not do.
// eslint-disable-next-line @typescript-eslint/no-explicit-any
export type AnyMethod = Method<any, any>;

/**
 * One `rpc_service`, as generated code describes it: all that bind, describe and the introspection
 * of a server need (spec/hprotocol.md, 6.1, 6.3 and 12).
 */
export interface Interface {
  /** With its namespace, "lab.Arm". */
  readonly name: string;
  /** 64 bits of all methods (hp-12.1); 0n if unknown. */
  readonly fingerprint: bigint;
  /** In the order of the schema. */
  readonly methods: readonly AnyMethod[];
  /** Which side decides the priority (hp-6.1-3); the client if absent. */
  readonly priorityModel?: "client_propagated" | "server_declared";
  /** 0 to 32767, absent if the schema states none. */
  readonly priority?: number;
  /** The interface's text (hp-12.2); without it only equal fingerprints match. */
  readonly text?: string;
  /** The service's complete schema, for tools without generated code. */
  readonly schema?: string;
  /** The version of the rtpmc that generated this. */
  readonly compilerVersion?: string;
}

/** A number in an event's payload, as a hub's `FieldEntry` states it. */
export interface EventField<F extends string = string> {
  /** With dots through structs and tables: "pose.position_m.x". */
  readonly name: F;
  /** bool, int8, uint8, … int64, uint64, float, double, counted from 0. */
  readonly type: number;
  /** The slots of nested tables, at most 4; empty if the payload is the bare struct. */
  readonly slots: readonly number[];
  /** The offset in the last slot's struct, in bytes. */
  readonly offset: number;
  /** number for a float or double, else bigint; absent without slots. */
  readonly defaultValue?: number | bigint;
}

/**
 * A table with `rtpm_event`, as generated code describes it (spec/events.md, 2).
 * F are the names of its numbers.
 */
export interface EventType<T, F extends string = string> {
  /** With its namespace, "lab.Touched". */
  readonly name: string;
  /** `rtpm_event`, 1 to 2147483647. */
  readonly type: number;
  /** Fingerprint of the payload's schema, 64 bits. */
  readonly schemaId: bigint;
  readonly codec: Codec<T>;
  /** The numbers that filters can read. */
  readonly fields: readonly EventField<F>[];
  /** A schema without includes whose root type is the event. */
  readonly schema?: string;
}

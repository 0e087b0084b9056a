import type { Method } from "./method.js";

/** A single call states these in place of the defaults. */
export interface CallOptions {
  /** 0 to 32767; the object's if absent. */
  readonly priority?: number;
  /** Relative to the call; the method's, or the node's, if absent. */
  readonly deadlineMs?: number;
  /** Cancels the call. */
  readonly signal?: AbortSignal;
}

/** Calls the methods of one object; a `Binding` is one, and generated clients use one. */
export interface Caller {
  /**
   * Calls a method of kind `call`, or `receipt`, which ends when the server has the request.
   * The promise rejects if the call fails.
   */
  call<Q, R>(method: Method<Q, R>, request: Q, options?: CallOptions): Promise<R>;
  /** Sends a `oneway`. It may get lost. */
  send<Q, R>(oneway: Method<Q, R>, request: Q, options?: CallOptions): void;
  /** Calls a `stream`; leaving the loop cancels it. */
  stream<Q, R>(method: Method<Q, R>, request: Q, options?: CallOptions): AsyncIterable<R>;
}

import type { Medium } from "../core/numbers.js";

/** A clock and its timers. Times are nanoseconds of a monotonic clock. */
export interface Clock {
  now(): number;
  /** Runs something once, at `time` or as soon as it can afterwards; the function cancels that. */
  at(time: number, run: () => void): () => void;
}

/** A socket that carries whole frames to one server. */
export interface Transport {
  /** Whether no frame leaves this host. */
  readonly isOnHost: boolean;
  send(frame: Uint8Array): void;
  close(): void;
}

/** The owner of a transport, which hears of its frames and its end. */
export interface TransportListener {
  /** One whole frame; untrusted. */
  onFrame(frame: Uint8Array): void;
  /** The connection is gone, or never came to be. Not called after close(). */
  onEnd(reason: string): void;
}

/** A way to reach one address of a server. */
export interface Route {
  readonly medium: Medium;
  /** For messages: "127.0.0.1:7420 over UDP". */
  readonly name: string;
  /** Why it has not connected yet, if it tries more than once. */
  readonly trouble?: string | undefined;
  /** Opens a transport, or rejects with the reason. */
  connect(listener: TransportListener): Promise<Transport>;
}

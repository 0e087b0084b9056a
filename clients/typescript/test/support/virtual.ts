import type { Clock, Route, Transport, TransportListener } from "../../src/client/transport.js";
import type { Medium } from "../../src/core/numbers.js";

/** A clock that moves when it is told to. */
export class VirtualClock implements Clock {
  private time = 0;
  private readonly timers = new Map<object, { readonly at: number; readonly run: () => void }>();

  now(): number {
    return this.time;
  }
  at(time: number, run: () => void): () => void {
    const key = {};
    this.timers.set(key, { at: time, run });
    return () => this.timers.delete(key);
  }
  moveTo(time: number): void {
    this.time = time;
    for (const [key, timer] of [...this.timers]) {
      if (timer.at > time || !this.timers.delete(key)) continue;
      timer.run();
    }
  }
}

/** Lets everything run that waits for nothing but its turn. */
export async function settle(): Promise<void> {
  for (let i = 0; i < 20; i += 1) await new Promise((resolve) => setImmediate(resolve));
}

/** A route whose frames the test takes and gives. */
export class VirtualRoute implements Route {
  readonly name = "the virtual server";
  readonly sent: { readonly frame: Uint8Array; readonly listener: TransportListener }[] = [];

  constructor(readonly medium: Medium) {}

  connect(listener: TransportListener): Promise<Transport> {
    const send = (frame: Uint8Array): void => {
      this.sent.push({ frame, listener });
    };
    return Promise.resolve({ isOnHost: false, send, close: () => undefined });
  }
}

import type { CallOptions } from "../values/caller.js";
import type { Interface } from "../values/method.js";
import type { Binding } from "./binding.js";
import type { Clock } from "./transport.js";

/** Binds objects by name or address; each `Node` is one. */
export interface Binder {
  bind(address: string, description: Interface, options?: CallOptions): Promise<Binding>;
  /** @internal */
  readonly clock: Clock;
  /** The domain of that clock (hp-4.1-7); 0n: unknown. @internal */
  readonly clockDomain: bigint;
  /** Closes something with the node; the function ends that. @internal */
  own(one: Owned): () => void;
}

/** Something that a node closes when it is closed. */
export interface Owned {
  close(): Promise<void>;
}

/** Waits on a clock. @throws the signal's reason */
export async function pause(clock: Clock, timeNs: number, signal?: AbortSignal): Promise<void> {
  signal?.throwIfAborted();
  await new Promise<void>((resolve) => {
    const cancel = clock.at(clock.now() + timeNs, () => end());
    const end = (): void => {
      cancel();
      signal?.removeEventListener("abort", end);
      resolve();
    };
    signal?.addEventListener("abort", end);
  });
  signal?.throwIfAborted();
}

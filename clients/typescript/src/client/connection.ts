import {
  ClientChannel,
  type CallParameters,
  type ChannelEvent,
  type ClientChannelConfig,
  type OpenCall,
} from "../core/client_channel.js";
import { contains, never } from "../core/numbers.js";
import { SealedClient, type SealedClientConfig } from "../sealed/client.js";
import { sealedPayloadMax } from "../sealed/frames.js";
import { CallError } from "./errors.js";
import type { Clock, Route, Transport } from "./transport.js";

/** How a call ended, as far as its connection knows. */
export type Outcome =
  | { readonly kind: "reply"; readonly status: number; readonly payload: Uint8Array }
  /** It was not begun; `too_large`, or `wrong_band` of the session. */
  | { readonly kind: "not_begun"; readonly reason: "too_large" | "wrong_band" }
  | { readonly kind: "timeout" }
  /** The server does not know the session that the call was sent in (hp-5.5-2). */
  | { readonly kind: "lost"; readonly epoch: bigint; readonly begun: number }
  /** The session or connection ended, and the call may have run. */
  | { readonly kind: "closed" }
  | { readonly kind: "disconnected" };

export interface ConnectionConfig {
  readonly route: Route;
  readonly clock: Clock;
  readonly channel: Omit<ClientChannelConfig, "medium" | "framePayloadMax">;
  /** Seals the sessions; absent for a server without a known key. */
  readonly sealed?: Omit<SealedClientConfig, "medium">;
}

interface Waiting {
  readonly priority: number;
  readonly start: () => void;
}

const waitingMax = 1024;

/** Waits for the end or the items of an open call. */
interface Ear {
  end(outcome: Outcome): void;
  wake(): void;
}

/** One channel to a server: its transport, its session, its open calls. */
export class Connection {
  readonly channel: ClientChannel;
  private readonly sealed: SealedClient | undefined;
  private transport: Transport | undefined;
  private opening: Promise<void> | undefined;
  private openingEar: ((error: CallError | undefined) => void) | undefined;
  private readonly ears = new Map<OpenCall, Ear>();
  private waiting: Waiting[] = [];
  private cancelTimer: (() => void) | undefined;
  private timerAt = never;
  private priority = 0;
  private generation = 0; // of transports, so that an old one's news is ignored

  constructor(private readonly config: ConnectionConfig) {
    const { medium } = config.route;
    const isSealed = config.sealed !== undefined;
    this.channel = new ClientChannel({
      ...config.channel,
      medium,
      ...(isSealed ? { framePayloadMax: sealedPayloadMax(medium) } : {}),
    });
    this.sealed = isSealed ? new SealedClient({ ...config.sealed!, medium }) : undefined;
  }

  /** Whether a session serves the priority now. */
  serves(priority: number): boolean {
    const { isReady, welcome } = this.channel;
    return isReady && welcome !== undefined && contains(welcome.band, priority);
  }
  /** Whether no handshake is on its way and no call is open. */
  get isIdle(): boolean {
    return this.opening === undefined && this.ears.size === 0 && this.waiting.length === 0;
  }
  get isOpening(): boolean {
    return this.opening !== undefined;
  }
  /** The priority that its session was opened for. */
  get openPriority(): number {
    return this.priority;
  }
  now(): number {
    return this.config.clock.now();
  }
  get epoch(): bigint | undefined {
    return this.channel.welcome?.serverEpoch;
  }

  /** Opens a session for the priority; several callers share one handshake. Throws CallError. */
  async open(priority: number, deadline: number, target: string): Promise<void> {
    while (!this.serves(priority)) {
      if (this.opening === undefined) {
        this.opening = this.handshake(priority, deadline, target).finally(() => {
          this.opening = undefined;
        });
      }
      await this.opening;
      if (!this.serves(priority) && this.channel.isReady) return; // of another band
    }
  }

  private async handshake(priority: number, deadline: number, target: string): Promise<void> {
    const { clock, route } = this.config;
    if (this.transport === undefined) await this.connect(deadline, target);
    const error = await new Promise<CallError | undefined>((resolve) => {
      this.openingEar = resolve;
      this.priority = priority;
      this.channel.open(priority, deadline, clock.now());
      this.flush();
    });
    this.openingEar = undefined;
    if (error === undefined) return;
    if (route.medium === "stream") this.end();
    throw new CallError(error.code, target, error.message, false);
  }

  private async connect(deadline: number, target: string): Promise<void> {
    const { clock, route } = this.config;
    const generation = ++this.generation;
    const isCurrent = (): boolean => generation === this.generation;
    const connecting = route.connect({
      onFrame: (frame) => {
        if (isCurrent()) this.receive(frame);
      },
      onEnd: (reason) => {
        if (isCurrent()) this.onEnd(reason);
      },
    });
    let cancel = (): void => undefined;
    const late = new Promise<undefined>((resolve) => {
      cancel = clock.at(deadline, () => resolve(undefined));
    });
    try {
      const transport = await Promise.race([connecting, late]);
      if (transport === undefined) {
        void connecting.then((one) => one.close()).catch(() => undefined);
        throw new Error(route.trouble ?? "it does not answer");
      }
      this.transport = transport;
      this.channel.setOnHost(transport.isOnHost);
    } catch (error) {
      const why = error instanceof Error ? error.message : String(error);
      throw new CallError("unreachable", target, `${route.name} cannot be reached: ${why}`, false);
    } finally {
      cancel();
    }
  }

  /**
   * Calls, once a session is ready and a call is free; resolves when the call ended.
   * @param priority  of waiting calls the highest begins first
   */
  async call(
    parameters: CallParameters,
    payload: Uint8Array,
    target: string,
    signal?: AbortSignal,
  ): Promise<Outcome> {
    signal?.throwIfAborted();
    const begun = await this.begin(parameters, payload, target, signal);
    if (!("callId" in begun)) return begun;
    if (!begun.isOpen) return { kind: "reply", status: 0, payload: new Uint8Array(0) };
    return await new Promise<Outcome>((resolve, reject) => {
      const onAbort = (): void => {
        this.cancel(begun);
        reject(signal?.reason as Error);
      };
      const end = (outcome: Outcome): void => {
        signal?.removeEventListener("abort", onAbort);
        resolve(outcome);
      };
      this.ears.set(begun, { end, wake: () => undefined });
      signal?.addEventListener("abort", onAbort, { once: true });
      if (signal?.aborted === true) onAbort();
    });
  }

  /** Sends a oneway now if it can; returns why not. */
  send(parameters: CallParameters, payload: Uint8Array): "sent" | "too_large" | "not_ready" {
    const now = this.config.clock.now();
    const call = this.channel.call({ ...parameters, delivery: "sent" }, payload, now);
    this.flush();
    if (call === "too_large") return "too_large";
    return typeof call === "string" ? "not_ready" : "sent";
  }

  /** The items of a stream; its end is the generator's result. */
  async *stream(
    parameters: CallParameters,
    payload: Uint8Array,
    target: string,
    signal?: AbortSignal,
  ): AsyncGenerator<Uint8Array, Outcome> {
    signal?.throwIfAborted();
    const call = await this.begin(parameters, payload, target, signal);
    if (!("callId" in call)) return call;
    let outcome: Outcome | undefined;
    let wake = (): void => undefined;
    this.ears.set(call, {
      end: (ended) => {
        outcome = ended;
        wake();
      },
      wake: () => wake(),
    });
    const onAbort = (): void => wake();
    signal?.addEventListener("abort", onAbort);
    try {
      for (;;) {
        signal?.throwIfAborted();
        const woken = new Promise<void>((resolve) => {
          wake = resolve;
        });
        const item = this.channel.nextItem(call, this.config.clock.now());
        this.flush();
        if (item !== undefined) {
          yield item;
        } else if (outcome !== undefined) {
          return outcome;
        } else {
          await woken;
        }
      }
    } finally {
      signal?.removeEventListener("abort", onAbort);
      this.cancel(call); // does nothing to one that ended
    }
  }

  /** Closes the session and the transport; open calls end as by `closed`. */
  close(): void {
    if (this.channel.isReady) {
      this.channel.close(this.config.clock.now());
      this.flush();
    }
    this.endCalls({ kind: "closed" });
    this.end();
  }

  // ---- calls -----------------------------------------------------------------------------------

  private cancel(call: OpenCall): void {
    this.ears.delete(call);
    this.channel.cancel(call, this.config.clock.now());
    this.flush();
  }

  private async begin(
    parameters: CallParameters,
    payload: Uint8Array,
    target: string,
    signal?: AbortSignal,
  ): Promise<OpenCall | Outcome> {
    const { clock } = this.config;
    for (;;) {
      const now = clock.now();
      if (now >= parameters.deadline) {
        throw new CallError("timeout", target, "the deadline passed before it could begin", false);
      }
      if (!this.channel.isReady) return { kind: "lost", epoch: 0n, begun: now };
      const call = this.channel.call(parameters, payload, now);
      this.flush();
      if (call === "window_full") {
        await this.waitForFreeCall(parameters, target, signal);
        continue;
      }
      return typeof call === "string" ? { kind: "not_begun", reason: call } : call;
    }
  }

  private async waitForFreeCall(
    parameters: CallParameters,
    target: string,
    signal?: AbortSignal,
  ): Promise<void> {
    if (this.waiting.length >= waitingMax) {
      throw new CallError("overload", target, `${waitingMax} calls wait for the server already`);
    }
    let cancelTimer = (): void => undefined;
    let start = (): void => undefined;
    await new Promise<void>((resolve) => {
      start = resolve;
      const { priority } = parameters;
      const behind = this.waiting.findIndex((one) => one.priority < priority);
      this.waiting.splice(behind < 0 ? this.waiting.length : behind, 0, { priority, start });
      cancelTimer = this.config.clock.at(parameters.deadline, resolve);
      signal?.addEventListener("abort", start, { once: true });
    });
    cancelTimer();
    signal?.removeEventListener("abort", start);
    const left = this.waiting.findIndex((one) => one.start === start);
    if (left >= 0) this.waiting.splice(left, 1);
    signal?.throwIfAborted();
  }

  private endCalls(outcome: Outcome): void {
    const ears = [...this.ears.values()];
    this.ears.clear();
    for (const ear of ears) ear.end(outcome);
    const waiting = this.waiting;
    this.waiting = [];
    for (const one of waiting) one.start();
  }

  // ---- frames and time -------------------------------------------------------------------------

  private receive(frame: Uint8Array): void {
    const now = this.config.clock.now();
    if (this.sealed === undefined) {
      this.channel.onFrame(frame, now);
    } else {
      this.sealed.receive(frame, now);
    }
    this.flush();
  }

  private flush(): void {
    const { clock } = this.config;
    for (;;) {
      const frames = this.channel.takeFrames();
      for (const frame of frames) {
        if (this.sealed === undefined) this.transport?.send(frame);
        else this.sealed.send(frame);
      }
      if (this.sealed === undefined) break;
      for (const frame of this.sealed.takeFrames()) this.transport?.send(frame);
      const delivered = this.sealed.takeDelivered();
      for (const frame of delivered) this.channel.onFrame(frame, clock.now());
      if (frames.length === 0 && delivered.length === 0) break;
    }
    for (const event of this.channel.takeEvents()) this.onEvent(event);
    if (this.sealed?.isBroken === true) this.onEnd("it does not keep to the protocol");
    this.setTimer();
    if (this.channel.hasFreeCall()) this.waiting.shift()?.start();
  }

  private setTimer(): void {
    const next = this.channel.nextTime();
    if (next === this.timerAt) return;
    this.cancelTimer?.();
    this.cancelTimer = undefined;
    this.timerAt = next;
    if (next === never) return;
    this.cancelTimer = this.config.clock.at(next, () => {
      this.timerAt = never;
      this.cancelTimer = undefined;
      this.channel.onTime(this.config.clock.now());
      this.flush();
    });
  }

  private onEvent(event: ChannelEvent): void {
    switch (event.kind) {
      case "ready":
        return this.openingEar?.(undefined);
      case "refused":
        return this.openingEar?.(this.openingError(event.status));
      case "items":
        return this.ears.get(event.call)?.wake();
      case "reply":
        return this.endCall(event.call, event);
      case "timeout":
        if (event.call !== undefined) return this.endCall(event.call, { kind: "timeout" });
        return this.openingEar?.(this.openingError(undefined));
      case "lost":
        for (const call of event.calls) {
          this.endCall(call, { kind: "lost", epoch: call.serverEpoch, begun: call.begun });
        }
        return undefined;
      case "closed":
        return this.endCalls({ kind: "closed" });
      case "broken":
        return this.onEnd("it does not keep to the protocol");
    }
  }

  private endCall(call: OpenCall, outcome: Outcome): void {
    const ear = this.ears.get(call);
    this.ears.delete(call);
    ear?.end(outcome);
  }

  private openingError(status: number | undefined): CallError {
    const { name } = this.config.route;
    const hint = this.sealed?.hint;
    if (status === undefined && hint === undefined) {
      const other = this.sealed?.otherKey === undefined ? "" : "; it has another key than ours";
      return new CallError("unreachable", name, `it does not answer${other}`);
    }
    const words: Partial<Record<number, string>> = {
      1: "it has no session left",
      11: "none of its lanes serves the priority",
      13: "it speaks no version of the protocol, or no sealed sessions, that we do",
      19: "it does not admit this client's key",
    };
    const why = words[status ?? hint ?? 0] ?? `it refused the session with status ${status}`;
    const code =
      (status ?? hint) === 19 ? "not_allowed" : status === 1 ? "overload" : "unreachable";
    return new CallError(code, name, why);
  }

  private onEnd(reason: string): void {
    this.end();
    this.openingEar?.(new CallError("unreachable", this.config.route.name, reason));
    this.endCalls({ kind: "disconnected" });
  }

  private end(): void {
    this.generation += 1;
    this.transport?.close();
    this.transport = undefined;
    this.channel.reset();
    this.sealed?.reset();
    this.cancelTimer?.();
    this.cancelTimer = undefined;
    this.timerAt = never;
  }
}

import {signal, type Signal} from '@preact/signals';
import {
  CallError,
  Client,
  type Channel,
  type Listener,
  type Message,
  type ServerInfo,
  type Socket,
} from '../protocol/client';
import type {Json} from '../protocol/json';

/**
 * `live`: something came within the last second. `silent`: open, but nothing came for a second.
 * `lost`: not connected, and trying again.
 */
export type Phase = 'connecting' | 'live' | 'silent' | 'lost';

export interface LinkState {
  readonly phase: Phase;
  /** When anything last came, as Date.now(); null: never. */
  readonly lastMs: number | null;
}

export interface LinkOptions {
  readonly open: () => Socket;
  /** A clock that only goes forward. */
  readonly nowMs: () => number;
}

export const kSilentMs = 1000;
/** So long after the last message a silent connection is given up. */
const kGiveUpMs = 5000;
const kFirstPauseMs = 500;
const kLongestPauseMs = 5000;
const kCheckMs = 100;
export const kCallTimeoutMs = 5000;

type Handler = (message: Message) => void;

/** Keeps a connection to the console, whatever happens, and says how it is. */
export class Link implements Listener {
  readonly state: Signal<LinkState> = signal({phase: 'connecting', lastMs: null});
  readonly info: Signal<ServerInfo | null> = signal(null);
  readonly channels: Signal<ReadonlyMap<string, Channel>> = signal(new Map());
  readonly services: Signal<ReadonlySet<string>> = signal(new Set());
  /** The last complaint of the server. */
  readonly complaint: Signal<{readonly message: string; readonly atMs: number} | null> =
    signal(null);
  onParameterChange: (names: readonly string[]) => void = () => undefined;

  private readonly interests = new Map<string, Set<Handler>>();
  private readonly watched = new Set<string>();
  private client: Client | null = null;
  private pauseMs = kFirstPauseMs;
  private heardMs = 0;
  private openedMs = 0;
  private retryMs = 0;
  private timer: ReturnType<typeof setInterval> | null = null;

  constructor(private readonly options: LinkOptions) {}

  start(): void {
    if (this.timer !== null) return;
    this.connect();
    this.timer = setInterval(() => this.check(), kCheckMs);
  }

  stop(): void {
    if (this.timer !== null) clearInterval(this.timer);
    this.timer = null;
    this.client?.close();
  }

  /** Judges the connection by the clock; also when a hidden page shows again. */
  check(): void {
    if (this.timer === null) return;
    const now = this.options.nowMs();
    if (this.client === null) {
      if (now >= this.retryMs) this.connect();
      return;
    }
    const quietMs = now - Math.max(this.heardMs, this.openedMs);
    if (quietMs > kGiveUpMs) this.client.close();
    else if (quietMs > kSilentMs && this.state.value.phase === 'live') this.become('silent');
  }

  get isLive(): boolean {
    return this.state.value.phase === 'live';
  }

  /** Calls `handle` with each message of the topic while it is advertised; returns its end. */
  subscribe(topic: string, handle: Handler): () => void {
    const handlers = this.interests.get(topic) ?? new Set();
    handlers.add(handle);
    this.interests.set(topic, handlers);
    this.client?.updateSubscriptions();
    return () => {
      handlers.delete(handle);
      if (handlers.size > 0 || this.interests.get(topic) !== handlers) return;
      this.interests.delete(topic);
      this.client?.updateSubscriptions();
    };
  }

  /** Asks to be told of changes of parameters, over reconnections, too. */
  watch(names: readonly string[]): void {
    const added = names.filter((name) => !this.watched.has(name));
    if (added.length === 0) return;
    added.forEach((name) => this.watched.add(name));
    this.client?.watchParameters(added);
  }

  /** Rejects with CallError. */
  call(service: string, request: Json, timeoutMs = kCallTimeoutMs): Promise<Json> {
    if (this.client === null) return Promise.reject(new CallError('the connection is lost', true));
    return this.client.call(service, request, timeoutMs);
  }

  get brokenCount(): number {
    return this.client?.brokenCount ?? 0;
  }

  onInfo(info: ServerInfo): void {
    this.info.value = info;
    this.pauseMs = kFirstPauseMs;
    if (this.watched.size > 0) this.client?.watchParameters([...this.watched]);
  }

  onChannels(channels: ReadonlyMap<string, Channel>): void {
    this.channels.value = new Map(channels);
  }

  onServices(names: ReadonlySet<string>): void {
    this.services.value = names;
  }

  onStatus(level: number, message: string): void {
    if (level >= 1) this.complaint.value = {message, atMs: Date.now()};
  }

  onParameters(names: readonly string[]): void {
    this.onParameterChange(names);
  }

  onTraffic(): void {
    this.heardMs = this.options.nowMs();
    if (this.state.value.phase !== 'live') this.become('live');
  }

  onClose(): void {
    this.client = null;
    this.retryMs = this.options.nowMs() + this.pauseMs;
    this.pauseMs = Math.min(2 * this.pauseMs, kLongestPauseMs);
    this.channels.value = new Map();
    this.services.value = new Set();
    this.become('lost');
  }

  private become(phase: Phase): void {
    const quietMs = this.options.nowMs() - this.heardMs;
    const lastMs = this.heardMs === 0 ? null : Date.now() - quietMs;
    this.state.value = {phase, lastMs};
  }

  private connect(): void {
    this.openedMs = this.options.nowMs();
    try {
      this.client = new Client(this.options.open(), this, this.interests);
    } catch {
      this.onClose();
    }
  }
}

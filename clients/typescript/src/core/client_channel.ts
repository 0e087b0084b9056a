import { plainBytes } from "./bytes.js";
import { ClockEstimator, type PeerClock } from "./clock.js";
import { readAck, writeAck, writeCredit } from "./control.js";
import { FrameCounters } from "./counters.js";
import { IncomingMessage, OutgoingMessage } from "./fragments.js";
import { cookieSize, readWelcome, writeHello, type Welcome } from "./handshake.js";
import { frameOf, headerAbout, newHeader, readFrame, type Header } from "./header.js";
import { IncomingStream } from "./incoming_stream.js";
import {
  Flag,
  FrameKind,
  Status,
  budgetUnlimited,
  callWindow,
  contains,
  copyIntervalMin,
  copyIntervalOnHost,
  fragmentCountMax,
  fragmentWindow,
  framePayloadMax,
  headerSize,
  microsecond,
  never,
  protocolVersion,
  sessionIdleMin,
  streamAskIntervalConnected,
  streamAskIntervalMax,
  streamBytesFirst,
  streamLease,
  streamLeaseMax,
  streamSilence,
  type DropReason,
  type Medium,
} from "./numbers.js";
import { CopyTimer, RoundTrip } from "./round_trip.js";

/**
 * Whether a call refused with unknown_session has certainly not run (hp-5.5-2): the server still
 * has the epoch that opened the session, and would have kept one that it heard since `begun`.
 */
export function hasNotRun(lostEpoch: bigint, epoch: bigint, begun: number, now: number): boolean {
  return lostEpoch === epoch && now - begun < sessionIdleMin;
}

export interface ClientChannelConfig {
  readonly medium: Medium;
  /** Random for each life of the program; not 0. */
  readonly clientEpoch: bigint;
  /** Tells the program's channels apart. */
  readonly channel: bigint;
  /** hp-4.1-7; 0n: not known. */
  readonly clockDomain?: bigint;
  /** The largest message in bytes; default: one frame's payload. */
  readonly messageSizeMax?: number;
  /** The largest payload of a frame in bytes, if less than the medium's (sec-4-3). */
  readonly framePayloadMax?: number;
  /** Calls open at a time, as far as the server grants them; default 8. */
  readonly openCallMax?: number;
  /** Random for each life of the program; the first handshake has the next number (hp-4-2). */
  readonly handshakeNumber?: number;
}

export interface CallParameters {
  readonly service: number;
  readonly method: number;
  readonly priority: number;
  readonly traceId?: bigint;
  /** On the clock of `now`; never for none. */
  readonly deadline: number;
  /** When the caller goes on (spec/hprotocol.md, 5.8); default `reply`. */
  readonly delivery?: "reply" | "receipt" | "sent";
  /** Items of a stream that are taken at a time, 1 to 32; 0 or absent: no stream. */
  readonly streamWindow?: number;
  /** How long the server keeps the stream without hearing of us, in ns; Infinity: while connected. */
  readonly streamLease?: number;
}

/** A call of a channel, until its event of kind `reply` or `timeout`, or the session's end. */
export class OpenCall {
  /** Still awaits its reply. */
  isOpen = true;
  /** A stream whose reply came; its last items may remain to be taken. */
  isEnded = false;
  /** @internal */ hasAnswered = false;
  /** @internal */ isCreditDue = false;
  /** @internal */ isAsking = false;
  /** @internal */ endStatus = 0;
  /** @internal */ request: OutgoingMessage | undefined;
  /** @internal */ reply: IncomingMessage | undefined;
  /** @internal */ items: IncomingStream | undefined;
  /** @internal */ limitSent = 0;
  /** @internal */ bytesSent = 0;
  /** @internal */ freedSent = 0;
  /** @internal */ lease = streamLease;
  /** @internal */ asked: number;
  /** @internal */ askCount = 1;
  /** @internal */ itemHeard: number;
  /** @internal */ itemGap = 0;
  /** @internal */ readonly timer: CopyTimer;

  constructor(
    /** @internal */ readonly header: Header,
    /** @internal */ readonly payload: Uint8Array,
    readonly deadline: number,
    /** When the call was sent first. */
    readonly begun: number,
    /** The epoch of the server that the call was sent to. */
    readonly serverEpoch: bigint,
    path: RoundTrip,
  ) {
    this.asked = this.itemHeard = begun;
    this.timer = new CopyTimer(path);
    this.timer.begin(begun);
  }
  get callId(): number {
    return this.header.callId;
  }
}

/** A change that the channel's owner learns of. */
export type ChannelEvent =
  /** The handshake is done. */
  | { readonly kind: "ready" }
  /** The handshake was refused. */
  | { readonly kind: "refused"; readonly status: number }
  /** Without a call it is the handshake's deadline; else the call's, or its server fell silent. */
  | { readonly kind: "timeout"; readonly call?: OpenCall }
  /** The end of a call; of a stream, nextItem() may still give items. */
  | {
      readonly kind: "reply";
      readonly call: OpenCall;
      readonly status: number;
      readonly payload: Uint8Array;
    }
  /** nextItem() has items. */
  | { readonly kind: "items"; readonly call: OpenCall }
  /** The server does not know the session: all calls are over, see hasNotRun(). */
  | { readonly kind: "lost"; readonly calls: readonly OpenCall[] }
  /** The server closed the session: all calls are over, and may have run. */
  | { readonly kind: "closed"; readonly calls: readonly OpenCall[] }
  /** Stream medium: this is not the H-Protocol; the owner ends the connection. */
  | { readonly kind: "broken"; readonly calls: readonly OpenCall[] };

const noBytes = new Uint8Array(0);

// hp-5.4-1: rounded up, so that 0 means that no time is left.
function budgetUs(deadline: number, now: number): number {
  if (deadline <= now) return 0;
  return Math.min(Math.ceil((deadline - now) / microsecond), budgetUnlimited);
}

/**
 * The client's side of the protocol, without I/O: handshake, calls, repetition, streams. Give it
 * frames and times; after each method take what takeFrames() and takeEvents() have, and call
 * onTime() at nextTime(). Times are nanoseconds of a monotonic clock.
 */
export class ClientChannel {
  readonly counters = new FrameCounters();
  readonly roundTrip = new RoundTrip();
  isReady = false;
  /** The number of copies of calls sent. */
  repeatCount = 0;
  private readonly medium: Medium;
  private readonly messageSizeMax: number;
  private readonly payloadMax: number;
  private readonly openCallMax: number;
  private readonly clockDomain: bigint;
  private readonly clock = new ClockEstimator();
  private readonly calls: OpenCall[] = []; // open, or ended with items left
  private frames: Uint8Array[] = [];
  private events: ChannelEvent[] = [];
  private isOpening = false;
  private mayAnswerCookie = false;
  private helloPriority = 0;
  private handshakeNumber: number;
  private helloDeadline = never;
  private cookie: Uint8Array = new Uint8Array(cookieSize);
  private granted: Welcome | undefined;
  private sessionId = 0n;
  private callId = 0;
  private readonly helloTimer = new CopyTimer(new RoundTrip());

  constructor(private readonly config: ClientChannelConfig) {
    this.medium = config.medium;
    this.payloadMax = Math.min(config.framePayloadMax ?? Infinity, framePayloadMax(config.medium));
    this.messageSizeMax = config.messageSizeMax ?? this.payloadMax;
    this.openCallMax = Math.min(config.openCallMax ?? callWindow, 64);
    this.clockDomain = config.clockDomain ?? 0n;
    this.handshakeNumber = config.handshakeNumber ?? 0;
  }

  /** Frames to send, oldest first. */
  takeFrames(): Uint8Array[] {
    const frames = this.frames;
    this.frames = [];
    return frames;
  }
  takeEvents(): ChannelEvent[] {
    const events = this.events;
    this.events = [];
    return events;
  }
  /** The server's grants in the last handshake. */
  get welcome(): Welcome | undefined {
    return this.granted;
  }
  get session(): bigint {
    return this.sessionId;
  }
  /** To a server on this host, calls are repeated later, as nothing is lost on the way (hp-5.3-1). */
  setOnHost(isOnHost: boolean): void {
    this.roundTrip.intervalMin = isOnHost ? copyIntervalOnHost : copyIntervalMin;
  }
  /** How far the server's clock is ahead; undefined before the first measurement. */
  peerClock(now: number): PeerClock | undefined {
    if (this.isOneClock()) return { offsetNs: 0, uncertaintyNs: 0 };
    return this.clock.estimate(now);
  }

  // ---- the session -----------------------------------------------------------------------------

  /** Begins a handshake for the band of the priority; ends open calls without an event. */
  open(priority: number, deadline: number, now: number): void {
    this.reset();
    this.isOpening = this.mayAnswerCookie = true;
    this.helloPriority = priority;
    this.handshakeNumber = (this.handshakeNumber + 1) >>> 0;
    this.helloDeadline = deadline;
    this.cookie = new Uint8Array(cookieSize);
    this.helloTimer.begin(now);
    this.sendHello(now);
  }

  /** Ends the session. */
  close(now: number): void {
    const header = newHeader(FrameKind.CLOSE, this.helloPriority, 0);
    header.session = this.sessionId;
    header.senderTimeNs = BigInt(Math.trunc(now));
    this.frames.push(frameOf(header));
    this.reset();
  }

  /** The connection is gone: the next call needs a handshake. Ends open calls without an event. */
  reset(): void {
    this.isReady = this.isOpening = false;
    this.endAll();
    this.sessionId = 0n;
  }

  /** When onTime() is due, unless a frame comes before. */
  nextTime(): number {
    if (this.isOpening) return Math.min(this.helloDeadline, this.helloTimer.due);
    return this.calls.reduce((next, call) => Math.min(next, this.due(call)), never);
  }

  onTime(now: number): void {
    if (this.isOpening) {
      this.onHelloTime(now);
      return;
    }
    for (const call of [...this.calls]) {
      while (call.isOpen && now >= this.due(call)) this.onCallTime(call, now);
    }
    this.pump(now);
  }

  /** @param frame  untrusted; one whole frame */
  onFrame(frame: Uint8Array, now: number): void {
    this.counters.receivedCount += 1;
    frame = plainBytes(frame);
    const header = readFrame(frame, this.medium);
    if (typeof header === "string") {
      this.drop(header);
      // hp-8-2: the beginning of the next frame is unknown.
      if (this.medium === "stream") {
        const calls = this.openCalls();
        this.reset();
        this.events.push({ kind: "broken", calls });
      }
      return;
    }
    this.onKind(header, frame.subarray(headerSize), now);
    this.pump(now);
  }

  private onKind(header: Header, payload: Uint8Array, now: number): void {
    switch (header.kind) {
      case FrameKind.REPLY:
        return this.onReply(header, payload, now);
      case FrameKind.ITEM:
        return this.onItem(header, payload, now);
      case FrameKind.COOKIE:
        return this.onCookie(header, payload, now);
      case FrameKind.WELCOME:
        return this.onWelcome(header, payload, now);
      case FrameKind.REFUSE:
        return this.onRefuse(header, payload);
      case FrameKind.ACK:
        return this.onAck(header, payload, now);
      case FrameKind.CLOSE:
        return this.onClose(header, payload);
      default:
        return this.drop("bad_kind"); // hp-3-1
    }
  }

  private sendHello(now: number): void {
    const payload = writeHello({
      versionMin: protocolVersion,
      versionMax: protocolVersion,
      features: 0,
      clientEpoch: this.config.clientEpoch,
      channel: this.config.channel,
      clockDomain: this.clockDomain,
      messageSizeMax: this.messageSizeMax,
      cookie: this.cookie,
    });
    const header = newHeader(FrameKind.HELLO, this.helloPriority, payload.length);
    header.flags = this.helloTimer.repeatCount > 0 ? Flag.repeated : 0;
    header.callId = this.handshakeNumber;
    header.senderTimeNs = BigInt(Math.trunc(now));
    this.frames.push(frameOf(header, payload));
  }

  private onHelloTime(now: number): void {
    if (now >= this.helloDeadline) {
      this.isOpening = false;
      this.events.push({ kind: "timeout" });
      return;
    }
    if (now < this.helloTimer.due) return;
    this.helloTimer.repeat(now);
    this.mayAnswerCookie = true;
    if (this.medium === "datagram") this.sendHello(now); // a stream loses no HELLO
  }

  private drop(reason: DropReason): void {
    this.counters.drop(reason);
  }

  // hp-4-3
  private isOfThisHandshake(header: Header): boolean {
    return this.isOpening && header.callId === this.handshakeNumber;
  }

  private onCookie(header: Header, payload: Uint8Array, now: number): void {
    if (!this.isOfThisHandshake(header) || this.medium === "stream") return this.drop("unexpected");
    if (payload.length !== cookieSize) return this.drop("bad_payload");
    this.cookie = payload.slice();
    // hp-4.2-4
    if (this.mayAnswerCookie) this.sendHello(now);
    this.mayAnswerCookie = false;
  }

  private onWelcome(header: Header, payload: Uint8Array, now: number): void {
    if (!this.isOfThisHandshake(header)) return this.drop("unexpected");
    const welcome = readWelcome(payload);
    // hp-4.3-1
    if (
      welcome === undefined ||
      header.session === 0n ||
      !contains(welcome.band, this.helloPriority)
    ) {
      return this.drop("bad_payload");
    }
    this.granted = welcome;
    this.sessionId = header.session;
    this.isReady = true;
    this.isOpening = false;
    this.helloTimer.end(now);
    this.events.push({ kind: "ready" });
  }

  private onRefuse(header: Header, payload: Uint8Array): void {
    if (header.status === Status.ok) return this.drop("unexpected"); // hp-4.4-3
    if (payload.length > 0) return this.drop("bad_payload"); // hp-4.4-2
    if (this.isOfThisHandshake(header) && header.session === 0n) {
      this.isOpening = false;
      this.events.push({ kind: "refused", status: header.status });
      return;
    }
    if (!this.isReady || header.session !== this.sessionId) return this.drop("unexpected");
    const refused = this.openCalls().find((call) => call.callId === header.callId);
    if (header.status === Status.unknown_session) {
      const calls = this.openCalls();
      if (refused !== undefined) {
        // hp-5.5-3
        this.isReady = false;
        this.endAll();
        this.events.push({ kind: "lost", calls });
        return;
      }
      // It is about a oneway or an ended call: open ones learn of it by themselves.
      if (calls.length === 0) this.isReady = false;
    }
    if (refused === undefined) return this.drop("unexpected");
    this.endCall(refused);
    this.events.push({ kind: "reply", call: refused, status: header.status, payload: noBytes });
  }

  // hp-4.5-2
  private onClose(header: Header, payload: Uint8Array): void {
    if (!this.isReady || header.session !== this.sessionId) return this.drop("unexpected");
    if (payload.length > 0) return this.drop("bad_payload");
    const calls = this.openCalls();
    this.reset();
    this.events.push({ kind: "closed", calls });
  }

  // ---- calls -----------------------------------------------------------------------------------

  hasFreeCall(): boolean {
    if (!this.isReady || this.granted === undefined) return false;
    return this.calls.length < Math.min(this.openCallMax, this.granted.window);
  }

  /**
   * Begins a call; isReady must be true. With delivery `sent` it is over at once.
   * @param payload  not changed until the call ends
   * @returns the call; or why none was begun: `too_large` for the server, `wrong_band` of the
   *   session (hp-5.1-8), `window_full` while as many are open as the session allows (hp-4.3-2)
   */
  call(
    parameters: CallParameters,
    payload: Uint8Array,
    now: number,
  ): OpenCall | "too_large" | "wrong_band" | "window_full" {
    const welcome = this.granted;
    if (welcome === undefined || !this.hasFreeCall()) return "window_full";
    if (!contains(welcome.band, parameters.priority)) return "wrong_band";
    const isSent = parameters.delivery === "sent";
    const isOneFrame = payload.length <= this.payloadMax;
    const sizeMax = Math.min(
      this.messageSizeMax,
      welcome.messageSizeMax,
      this.payloadMax * fragmentCountMax,
    );
    if (payload.length > sizeMax || (isSent && !isOneFrame)) return "too_large";
    const header = newHeader(FrameKind.CALL, parameters.priority, payload.length);
    header.session = this.sessionId;
    this.callId = header.callId = this.nextCallId(welcome.window);
    header.service = parameters.service;
    header.method = parameters.method;
    header.traceId = parameters.traceId ?? 0n;
    if (isSent) header.flags = Flag.noReply;
    if (parameters.delivery === "receipt") header.flags = Flag.replyOnReceipt;
    const call = new OpenCall(
      header,
      payload,
      parameters.deadline,
      now,
      welcome.serverEpoch,
      this.roundTrip,
    );
    this.beginStream(call, parameters);
    if (isSent) {
      call.isOpen = false;
      this.sendCall(call, now);
      return call;
    }
    this.calls.push(call);
    if (isOneFrame) {
      this.sendCall(call, now);
    } else {
      const window = fragmentWindow(this.medium);
      call.request = new OutgoingMessage(header, payload, this.payloadMax, window);
      this.pump(now);
    }
    return call;
  }

  private beginStream(call: OpenCall, parameters: CallParameters): void {
    const window = parameters.streamWindow ?? 0;
    if (window === 0) return;
    call.header.item = call.limitSent = window;
    call.items = new IncomingStream(this.medium, window, this.messageSizeMax);
    call.bytesSent = streamBytesFirst(this.medium);
    call.lease = parameters.streamLease ?? streamLease;
    if (this.medium === "datagram") call.lease = Math.min(call.lease, streamLeaseMax);
  }

  /** Ends a call whose caller gave up; it may have run. */
  cancel(call: OpenCall, now: number): void {
    if (!this.calls.includes(call)) return;
    this.endCall(call);
    this.sendCancel(call.header, now);
  }

  /**
   * The next item of a stream; undefined if none is there now. After the stream's `reply` and its
   * last item, this releases the call.
   */
  nextItem(call: OpenCall, now: number): Uint8Array | undefined {
    if (call.items === undefined || !this.calls.includes(call)) return undefined;
    const item = call.items.next();
    if (item === undefined && call.isEnded) {
      this.endCall(call);
      return undefined;
    }
    this.lookAtCredit(call);
    // One CREDIT for all items that had arrived.
    if (item === undefined) this.pump(now);
    return item;
  }

  // hp-4.3-2: numbers may be left out.
  private nextCallId(window: number): number {
    let id = (this.callId + 1) >>> 0;
    while (this.calls.some((call) => ((id - call.callId) >>> 0) % window === 0))
      id = (id + 1) >>> 0;
    return id;
  }

  private openCalls(): OpenCall[] {
    return this.calls.filter((call) => call.isOpen && !call.isEnded);
  }

  private endCall(call: OpenCall): void {
    call.isOpen = false;
    call.request = call.reply = undefined;
    const index = this.calls.indexOf(call);
    if (index >= 0) this.calls.splice(index, 1);
  }

  // The items of a stream that ended can still be taken.
  private endAll(): void {
    for (const call of this.openCalls()) this.endCall(call);
  }

  // hp-5.10-7: of a stream the budget says how long we may be silent.
  private budgetOf(call: OpenCall, now: number): number {
    const isLeased = call.items !== undefined && call.deadline - now > call.lease;
    return budgetUs(isLeased ? now + call.lease : call.deadline, now);
  }

  private sendCall(call: OpenCall, now: number): void {
    call.header.budgetUs = this.budgetOf(call, now);
    call.header.senderTimeNs = BigInt(Math.trunc(now));
    this.frames.push(frameOf(call.header, call.payload));
  }

  private sendCancel(about: Header, now: number): void {
    this.frames.push(frameOf(headerAbout(about, FrameKind.CANCEL, 0, now)));
  }

  // Sends the fragments and CREDITs that may go out.
  private pump(now: number): void {
    for (const call of this.calls) {
      if (call.isCreditDue) this.sendCredit(call, now);
      if (call.request === undefined) continue;
      for (;;) {
        const frame = call.request.next(this.budgetOf(call, now), now);
        if (frame === undefined) break;
        this.frames.push(frame);
      }
    }
  }

  // hp-5.1-3
  private find(header: Header): OpenCall | undefined {
    if (header.session !== this.sessionId) return undefined;
    return this.calls.find(
      (call) =>
        call.callId === header.callId &&
        call.header.service === header.service &&
        call.header.method === header.method,
    );
  }

  // ---- time ------------------------------------------------------------------------------------

  // Whether to ask after items instead of repeating the call.
  private isStreamKnown(call: OpenCall): boolean {
    if (call.items === undefined) return false;
    return call.hasAnswered || (this.medium === "stream" && call.request === undefined);
  }

  private due(call: OpenCall): number {
    if (call.isEnded) return never;
    // hp-5.3-4, hp-5.10-5
    if (this.medium === "stream" && !this.isStreamKnown(call)) return call.deadline;
    return Math.min(call.deadline, call.timer.due);
  }

  private onCallTime(call: OpenCall, now: number): void {
    const isStream = call.items !== undefined;
    // hp-5.10-7: a reader that was busy elsewhere has asked nothing.
    const isSilent = isStream && call.askCount >= 3 && now - call.asked >= streamSilence;
    if (now < call.deadline && !isSilent) {
      this.repeat(call, now);
      return;
    }
    // The server knows a call's deadline by itself, but not a stream's.
    if (isStream) this.sendCancel(call.header, now);
    this.endCall(call);
    this.events.push({ kind: "timeout", call });
  }

  private repeat(call: OpenCall, now: number): void {
    const isAsking = this.isStreamKnown(call);
    if (this.medium === "stream" && !isAsking) return;
    this.repeatCount += 1;
    call.timer.repeat(now);
    if (call.askCount === 0) call.asked = now;
    call.askCount += 1;
    if (isAsking) {
      this.askAfter(call, call.timer.current, now);
      call.isAsking = true;
      this.sendCredit(call, now);
    } else if (call.request !== undefined && !call.request.isAcknowledged()) {
      call.request.nudge();
    } else if (call.reply !== undefined) {
      this.sendReplyAck(call, call.reply, true, now);
    } else if (call.request !== undefined) {
      this.frames.push(call.request.firstAgain(this.budgetOf(call, now), now));
    } else {
      call.header.flags |= Flag.repeated;
      if (call.items !== undefined) call.header.flags |= Flag.ackWanted; // hp-5.10-3
      this.sendCall(call, now);
    }
  }

  // ---- replies ---------------------------------------------------------------------------------

  private onReply(header: Header, payload: Uint8Array, now: number): void {
    const call = this.find(header);
    if (call === undefined || call.isEnded) return this.drop("unexpected");
    if (call.items !== undefined) return this.onStreamEnd(call, call.items, header, payload, now);
    if (header.fragmentCount > 1) return this.onLargeReply(call, header, payload, now);
    this.learnClock(call, header, now);
    this.endCall(call);
    call.timer.end(now);
    this.events.push({ kind: "reply", call, status: header.status, payload: payload.slice() });
  }

  private isOneClock(): boolean {
    return this.clockDomain !== 0n && this.clockDomain === this.granted?.clockDomain;
  }

  // hp-5.7-1
  private learnClock(call: OpenCall, reply: Header, now: number): void {
    const sent = Number(reply.senderTimeNs);
    const isCopy = call.timer.repeatCount > 0 || (reply.flags & Flag.repeated) !== 0;
    if (this.isOneClock() || isCopy || call.request !== undefined || sent > 2 ** 61) return;
    this.clock.add(call.begun, sent - reply.budgetUs * microsecond, sent, now);
  }

  private onLargeReply(call: OpenCall, header: Header, payload: Uint8Array, now: number): void {
    if (header.messageSize > this.messageSizeMax) return this.drop("bad_length"); // hp-5.6-5
    call.reply ??= new IncomingMessage(header);
    const taken = call.reply.take(header, payload);
    if (taken === "foreign") return this.drop("bad_fragment");
    call.timer.progress(now);
    if (taken !== "last") {
      if ((header.flags & Flag.ackWanted) !== 0) this.sendReplyAck(call, call.reply, false, now);
      return;
    }
    const { message } = call.reply;
    this.sendReplyAck(call, call.reply, false, now); // hp-5.6-8
    this.endCall(call);
    call.timer.end(now);
    this.events.push({ kind: "reply", call, status: header.status, payload: message });
  }

  private sendReplyAck(
    call: OpenCall,
    reply: IncomingMessage,
    isAsking: boolean,
    now: number,
  ): void {
    const payload = writeAck(reply.ack());
    const header = headerAbout(call.header, FrameKind.ACK, payload.length, now);
    if (isAsking) header.flags = Flag.ackWanted; // hp-5.6-7
    this.frames.push(frameOf(header, payload));
  }

  private onAck(header: Header, payload: Uint8Array, now: number): void {
    const call = this.find(header);
    const isStream = call?.items !== undefined && !call.isEnded;
    if (call === undefined || (call.request === undefined && !isStream)) {
      return this.drop("unexpected");
    }
    const ack = readAck(payload);
    if (ack === undefined) return this.drop("bad_payload");
    call.request?.onAck(ack, false);
    if (isStream && (call.request === undefined || call.request.isAcknowledged())) {
      this.hear(call);
      this.askAfter(call, call.timer.current, now); // hp-5.10-5
    } else {
      call.timer.progress(now);
    }
  }

  // ---- streams ---------------------------------------------------------------------------------

  // The server has the call.
  private hear(call: OpenCall): void {
    call.hasAnswered = true;
    call.request = undefined;
    call.askCount = 0;
  }

  // The pace of the items says when the next question is due.
  private hearOfItems(call: OpenCall, now: number): void {
    this.hear(call);
    const least = this.medium === "stream" ? streamAskIntervalConnected : this.roundTrip.interval();
    const isMidway = call.items?.isMidway() ?? false;
    this.askAfter(call, isMidway ? least : Math.max(4 * call.itemGap, least), now);
  }

  private askAfter(call: OpenCall, wait: number, now: number): void {
    call.timer.wait(now, Math.min(wait, streamAskIntervalMax, streamSilence / 4));
  }

  private onItem(header: Header, payload: Uint8Array, now: number): void {
    const call = this.find(header);
    if (call?.items === undefined) {
      this.drop("unexpected");
      // hp-5.9-3: an earlier CANCEL was lost.
      if (this.isReady && header.session === this.sessionId && call === undefined) {
        this.sendCancel(header, now);
      }
      return;
    }
    const { items } = call;
    if (call.isEnded) return this.drop("unexpected");
    if (header.messageSize > this.messageSizeMax) return this.drop("bad_length"); // hp-5.10-10
    const revealsGap = items.revealsGap(header.item);
    const droppedBefore = items.droppedCount;
    const taken = items.take(header, payload);
    if (taken === "foreign") return this.drop("unexpected");
    const isDuplicate = taken === "duplicate";
    if (isDuplicate || items.droppedCount !== droppedBefore) this.drop("unexpected");
    if (!isDuplicate && (header.flags & Flag.repeated) === 0 && header.fragmentIndex === 0) {
      // A long pause does not dominate the mean.
      const gap = Math.min(now - call.itemHeard, streamAskIntervalMax / 4);
      call.itemGap += Math.trunc((gap - call.itemGap) / 8);
      call.itemHeard = now;
    }
    this.hearOfItems(call, now);
    // hp-5.10-4: once for each gap, and never for a copy.
    if (revealsGap && !isDuplicate) call.isCreditDue = true;
    this.lookAtCredit(call);
    if (items.isComplete()) {
      this.endStream(call, noBytes, now);
    } else if (items.hasNext()) {
      this.events.push({ kind: "items", call });
    }
  }

  private onStreamEnd(
    call: OpenCall,
    items: IncomingStream,
    header: Header,
    payload: Uint8Array,
    now: number,
  ): void {
    // hp-5.10-6: other frames will still come.
    const { expired, cancelled, stopping, lost } = Status;
    const isGivenUp = ([expired, cancelled, stopping, lost] as number[]).includes(header.status);
    const isCopy = items.isEnded;
    if (!isGivenUp && !items.endAt(header.item)) return this.drop("unexpected");
    call.endStatus = header.status;
    // From now on only items are progress: a server that can't send those it counted is silent.
    if (isCopy && !isGivenUp) return;
    this.hearOfItems(call, now);
    if (isGivenUp || items.isComplete()) {
      // hp-7-1: the refusal of a stream says why.
      this.endStream(call, header.item === 0 ? payload.slice() : noBytes, now);
      return;
    }
    call.isAsking = true;
    this.sendCredit(call, now);
  }

  // The last CREDIT lets the server release the frames.
  private endStream(call: OpenCall, payload: Uint8Array, now: number): void {
    call.isEnded = true;
    this.sendCredit(call, now);
    this.events.push({ kind: "reply", call, status: call.endStatus, payload });
  }

  private lookAtCredit(call: OpenCall): void {
    if (call.isEnded || !call.hasAnswered || call.items === undefined) return;
    if (call.items.isCreditDue(call.limitSent, call.bytesSent, call.freedSent)) {
      call.isCreditDue = true;
    }
  }

  private sendCredit(call: OpenCall, now: number): void {
    if (call.items === undefined) return;
    const credit = call.items.credit();
    const payload = writeCredit(credit);
    const header = headerAbout(call.header, FrameKind.CREDIT, payload.length, now);
    header.flags = call.isAsking ? Flag.ackWanted : 0;
    header.budgetUs = this.budgetOf(call, now);
    header.item = call.limitSent = call.items.limit();
    call.bytesSent = credit.byteLimit;
    call.freedSent = call.items.freedCount;
    call.isCreditDue = call.isAsking = false;
    this.frames.push(frameOf(header, payload));
  }
}

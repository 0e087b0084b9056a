import { ahead, isZero, plainBytes } from "./bytes.js";
import { readAck, readCredit, writeAck, type FragmentAck } from "./control.js";
import { CookieJar } from "./cookie.js";
import { FrameCounters } from "./counters.js";
import { IncomingMessage, OutgoingMessage, ackOfAll } from "./fragments.js";
import { isAllowedMessageSize, readHello, writeWelcome, type Hello } from "./handshake.js";
import { frameOf, headerAbout, markRepeated, newHeader, readFrame, type Header } from "./header.js";
import { LargeMessages, type LargeMessage } from "./large_messages.js";
import {
  Flag,
  FrameKind,
  SessionMethod,
  Status,
  allPriorities,
  budgetUnlimited,
  callWindow,
  contains,
  fragmentCountMax,
  fragmentWindow,
  framePayloadMax,
  headerSize,
  microsecond,
  millisecond,
  never,
  priorityHighest,
  protocolVersion,
  sessionIdleMin,
  sessionService,
  streamLeaseMax,
  type Band,
  type DropReason,
  type Medium,
} from "./numbers.js";
import { OutgoingStream } from "./outgoing_stream.js";
import { StrangerLimit, shareOfOneHost, type Peer } from "./peer.js";

export interface ServerSessionsConfig {
  readonly medium: Medium;
  /** Random for each life of the program; not 0. */
  readonly epoch: bigint;
  /** Fills bytes with random ones, as crypto.getRandomValues does. */
  readonly random: (bytes: Uint8Array) => Uint8Array;
  /** The bands of the lanes (hp-11-1); default: one of all priorities. */
  readonly bands?: readonly Band[];
  /** Calls above are refused; default: none is. */
  readonly ceiling?: number;
  readonly clockDomain?: bigint;
  /** Sessions of a lane; default 256. */
  readonly sessionCountMax?: number;
  /** The largest message in bytes; default: one frame's payload. */
  readonly messageSizeMax?: number;
  /** The largest payload of a frame in bytes, if less than the medium's. */
  readonly framePayloadMax?: number;
  /** Messages larger than a frame at a time; default 32. */
  readonly largeMessageCountMax?: number;
  /** Streams at a time; default 16. */
  readonly streamCountMax?: number;
}

interface StreamState {
  readonly items: OutgoingStream;
  deadline: number;
  /** The rest of an item that was sent in part. */
  pending: Uint8Array | undefined;
}

interface Slot {
  state: "receiving" | "running" | "done";
  /** Runs without a caller that waits: a oneway, or cancelled. */
  isUnawaited: boolean;
  isEvicted: boolean;
  isReplied: boolean;
  callId: number;
  /** May be a later call that was refused while this one ran. */
  newestCallId: number;
  request?: Request;
  /** The reply, kept over datagrams for copies of the call. */
  reply?: Uint8Array;
  large?: LargeMessage<Slot>;
  stream?: StreamState;
}

interface Session {
  readonly id: bigint;
  readonly peer: Peer;
  readonly lane: number;
  readonly clientEpoch: bigint;
  readonly channel: bigint;
  readonly handshakeNumber: number;
  readonly hasOurClock: boolean;
  readonly messageSizeMax: number;
  lastHeard: number;
  readonly slots: (Slot | undefined)[];
}

/** A call for the application to run. */
export class Request {
  constructor(
    readonly header: Header,
    readonly payload: Uint8Array,
    readonly peer: Peer,
    readonly received: number,
    /** On the clock of `received`. */
    readonly deadline: number,
  ) {}
  /** The caller is answered before the method runs: accept() comes first. */
  get wantsReceipt(): boolean {
    return (this.header.flags & Flag.replyOnReceipt) !== 0;
  }
  get wantsStream(): boolean {
    return this.header.item > 0;
  }
}

export type ServerEvent =
  /** Run the request: complete() it once, now or later. */
  | { readonly kind: "run"; readonly request: Request }
  /** The caller gave up; complete() the request still. */
  | { readonly kind: "cancelled"; readonly request: Request }
  /** A stream takes items again. */
  | { readonly kind: "credit"; readonly request: Request }
  /** Stream medium: not this protocol; the owner ends the connection. */
  | { readonly kind: "hang_up"; readonly peer: Peer };

export interface Outgoing {
  readonly frame: Uint8Array;
  readonly peer: Peer;
}

const noBytes = new Uint8Array(0);

/**
 * The server's side of the protocol for one medium, without I/O: sessions, at most once, refusals,
 * streams. Give it frames and times; after each method take what takeFrames() and takeEvents()
 * have, and call onTime() at nextTime(). Times are nanoseconds of a monotonic clock.
 */
export class ServerSessions {
  readonly counters = new FrameCounters();
  private readonly medium: Medium;
  private readonly bands: readonly Band[];
  private readonly ceiling: number;
  private readonly clockDomain: bigint;
  private readonly sessionCountMax: number;
  private readonly payloadMax: number;
  private readonly messageSizeMax: number;
  private readonly streamCountMax: number;
  /** For a layer that judges handshakes itself, as that of sealed sessions does. */
  readonly cookies: CookieJar;
  private readonly strangers: StrangerLimit;
  private readonly large: LargeMessages<Slot>;
  private readonly sessions = new Map<bigint, Session>();
  private readonly streams = new Map<StreamState, Slot>();
  private readonly laneOfConnection = new Map<string, number>();
  private waitingReplies: { request: Request; status: number; payload: Uint8Array }[] = [];
  private frames: Outgoing[] = [];
  private events: ServerEvent[] = [];

  constructor(private readonly config: ServerSessionsConfig) {
    this.medium = config.medium;
    this.bands = config.bands ?? [allPriorities];
    this.ceiling = config.ceiling ?? priorityHighest;
    this.clockDomain = config.clockDomain ?? 0n;
    this.sessionCountMax = config.sessionCountMax ?? 256;
    this.payloadMax = Math.min(config.framePayloadMax ?? Infinity, framePayloadMax(config.medium));
    this.large = new LargeMessages(config.largeMessageCountMax ?? 32);
    const sizeMax = this.large.capacity > 0 ? this.payloadMax * fragmentCountMax : this.payloadMax;
    this.messageSizeMax = Math.min(config.messageSizeMax ?? this.payloadMax, sizeMax);
    this.streamCountMax = config.streamCountMax ?? 16;
    const secret = config.random(new Uint8Array(16));
    this.cookies = new CookieJar(secret);
    this.strangers = new StrangerLimit(
      config.random(new Uint8Array(1)),
      Math.max(256, this.sessionCountMax),
      2 * millisecond,
    );
  }

  /** Frames to send, oldest first. */
  takeFrames(): Outgoing[] {
    const frames = this.frames;
    this.frames = [];
    return frames;
  }
  takeEvents(): ServerEvent[] {
    const events = this.events;
    this.events = [];
    return events;
  }
  get sessionCount(): number {
    return this.sessions.size;
  }
  /** Whether a session has this number now. */
  isKnown(session: bigint): boolean {
    return this.sessions.has(session);
  }
  hasSession(peer: Peer): boolean {
    return this.sessionsOf(peer).length > 0;
  }

  /** @param frame  untrusted; one whole frame */
  onFrame(frame: Uint8Array, peer: Peer, now: number): void {
    this.counters.receivedCount += 1;
    frame = plainBytes(frame);
    const header = readFrame(frame, this.medium);
    if (typeof header === "string") {
      this.drop(header);
      if (this.medium === "stream") this.events.push({ kind: "hang_up", peer }); // hp-8-2
      return;
    }
    this.onKind(header, frame.subarray(headerSize), peer, now);
    this.sendWaiting(now);
  }

  private onKind(header: Header, payload: Uint8Array, peer: Peer, now: number): void {
    switch (header.kind) {
      case FrameKind.CALL:
        return this.onCall(header, payload, peer, now);
      case FrameKind.HELLO:
        return this.onHello(header, payload, peer, now);
      case FrameKind.CLOSE:
        return this.onClose(header, payload, peer);
      case FrameKind.ACK:
        return this.onAck(header, payload, peer, now);
      case FrameKind.CANCEL:
        return this.onCancel(header, payload, peer, now);
      case FrameKind.CREDIT:
        return this.onCredit(header, payload, peer, now);
      default:
        return this.drop("bad_kind"); // hp-3-1
    }
  }

  /** Ends streams whose caller was silent for too long, and sends replies that waited. */
  onTime(now: number): void {
    for (const [stream, slot] of [...this.streams]) {
      if (stream.deadline > now) continue;
      if (slot.state === "running") this.counters.expiredCount += 1;
      this.cancelSlot(slot); // hp-5.10-7
      this.freeStream(slot);
    }
    this.large.hasFreed ||= this.waitingReplies.length > 0;
    this.sendWaiting(now);
  }

  /** When onTime() is due. */
  nextTime(now: number): number {
    let next = never;
    for (const stream of this.streams.keys()) next = Math.min(next, stream.deadline);
    if (this.waitingReplies.length > 0) next = Math.min(next, this.large.nextIdleTime(now));
    return this.waitingReplies.reduce((time, one) => Math.min(time, one.request.deadline), next);
  }

  // ---- sessions --------------------------------------------------------------------------------

  private drop(reason: DropReason): void {
    this.counters.drop(reason);
  }
  private send(peer: Peer, frame: Uint8Array): void {
    this.frames.push({ frame, peer });
  }

  // hp-4.4-2: a bare header, never larger than what it answers.
  private refuse(about: Header, status: number, peer: Peer, now: number): void {
    this.counters.refusedCount += 1;
    const header = newHeader(FrameKind.REFUSE, about.priority, 0);
    header.session = about.session;
    header.callId = about.callId;
    header.status = status;
    header.senderTimeNs = BigInt(Math.trunc(now));
    this.send(peer, frameOf(header));
  }

  // hp-11-2
  private laneOf(header: Header, peer: Peer): number {
    if (this.medium === "stream") {
      const lane = this.laneOfConnection.get(peer.key);
      if (lane !== undefined) return lane;
    }
    return Math.max(
      this.bands.findIndex((band) => contains(band, header.priority)),
      0,
    );
  }
  private bandOf(lane: number): Band {
    return this.bands[lane] ?? allPriorities;
  }

  // hp-4.1-2, hp-4.1-3
  private faultOf(header: Header, hello: Hello, lane: number): number | undefined {
    if (hello.versionMin > protocolVersion || hello.versionMax < protocolVersion) {
      return Status.version_unsupported;
    }
    if (!isAllowedMessageSize(hello.messageSizeMax)) return Status.bad_limits;
    return contains(this.bandOf(lane), header.priority) ? undefined : Status.wrong_band;
  }

  private onHello(header: Header, payload: Uint8Array, peer: Peer, now: number): void {
    const hello = readHello(payload);
    if (hello === undefined) return this.drop("bad_payload");
    const isProven =
      this.medium === "stream" ||
      this.cookies.isGood(hello.cookie, peer.key, hello.clientEpoch, now);
    if (!isProven && !this.strangers.admit(peer, now)) return this.drop("rate_limited");
    const lane = this.laneOf(header, peer);
    const fault = this.faultOf(header, hello, lane);
    if (fault !== undefined) return this.refuse(header, fault, peer, now);
    if (!isProven) return this.giveCookie(header, hello, peer, now);
    if (this.isLate(hello, header.callId, peer, lane)) return this.drop("unexpected");
    const session = this.findOrOpen(hello, header.callId, peer, lane, now);
    if (session === undefined) return this.refuse(header, Status.overload, peer, now);
    if (this.medium === "stream") this.laneOfConnection.set(peer.key, lane);
    const welcome = writeWelcome({
      band: this.bandOf(lane),
      ceiling: this.ceiling,
      features: 0,
      window: callWindow,
      serverEpoch: this.config.epoch,
      clockDomain: this.clockDomain,
      messageSizeMax: this.messageSizeMax,
    });
    const answer = newHeader(FrameKind.WELCOME, header.priority, welcome.length);
    answer.callId = header.callId;
    answer.session = session.id;
    answer.senderTimeNs = BigInt(Math.trunc(now));
    this.send(peer, frameOf(answer, welcome));
  }

  // hp-4.2-1
  private giveCookie(header: Header, hello: Hello, peer: Peer, now: number): void {
    if (!isZero(hello.cookie)) this.drop("bad_cookie");
    const cookie = this.cookies.give(peer.key, hello.clientEpoch, now);
    const answer = newHeader(FrameKind.COOKIE, header.priority, cookie.length);
    answer.callId = header.callId;
    answer.senderTimeNs = BigInt(Math.trunc(now));
    this.send(peer, frameOf(answer, cookie));
  }

  private isOf(session: Session, hello: Hello, peer: Peer, lane: number): boolean {
    return (
      session.lane === lane &&
      session.peer.key === peer.key &&
      session.clientEpoch === hello.clientEpoch &&
      session.channel === hello.channel
    );
  }

  // hp-4.1-6
  private isLate(hello: Hello, number: number, peer: Peer, lane: number): boolean {
    if (this.medium === "stream") return false;
    return [...this.sessions.values()].some(
      (session) =>
        this.isOf(session, hello, peer, lane) && ahead(number, session.handshakeNumber) < 0,
    );
  }

  private sessionsOf(peer: Peer): Session[] {
    return [...this.sessions.values()].filter((session) => session.peer.key === peer.key);
  }

  private findOrOpen(
    hello: Hello,
    number: number,
    peer: Peer,
    lane: number,
    now: number,
  ): Session | undefined {
    const ofLane = [...this.sessions.values()].filter((session) => session.lane === lane);
    const same = ofLane.find(
      (session) => this.isOf(session, hello, peer, lane) && session.handshakeNumber === number,
    );
    if (same !== undefined) {
      same.lastHeard = now; // hp-4.1-4
      return same;
    }
    // hp-4-4, hp-4.1-6
    const replaced =
      this.medium === "stream"
        ? this.sessionsOf(peer)[0]
        : ofLane.find((session) => this.isOf(session, hello, peer, lane));
    if (replaced !== undefined) {
      this.endSession(replaced);
    } else if (!this.makeSpace(ofLane, peer, now)) {
      return undefined;
    }
    const session: Session = {
      id: this.newSessionId(),
      peer,
      lane,
      clientEpoch: hello.clientEpoch,
      channel: hello.channel,
      handshakeNumber: number,
      hasOurClock: hello.clockDomain !== 0n && hello.clockDomain === this.clockDomain,
      messageSizeMax: hello.messageSizeMax,
      lastHeard: now,
      slots: new Array<Slot | undefined>(callWindow).fill(undefined),
    };
    this.sessions.set(session.id, session);
    this.counters.sessionOpenedCount += 1;
    return session;
  }

  // hp-4-7, hp-5.5-1: a host with its full quota replaces only its own sessions.
  private makeSpace(ofLane: readonly Session[], peer: Peer, now: number): boolean {
    const own = ofLane.filter((session) => session.peer.host === peer.host);
    const isOwnFull =
      this.medium === "datagram" && own.length >= shareOfOneHost(this.sessionCountMax);
    if (!isOwnFull && ofLane.length < this.sessionCountMax) return true;
    const candidates = isOwnFull ? own : ofLane;
    const [silent] = [...candidates].sort((a, b) => a.lastHeard - b.lastHeard);
    if (silent === undefined || now - silent.lastHeard < sessionIdleMin) return false;
    this.counters.sessionEvictedCount += 1;
    this.endSession(silent);
    return true;
  }

  private newSessionId(): bigint {
    for (;;) {
      const bytes = this.config.random(new Uint8Array(8));
      const id = new DataView(bytes.buffer, bytes.byteOffset, 8).getBigUint64(0, true);
      if (id !== 0n && !this.sessions.has(id)) return id;
    }
  }

  // hp-4.4-1, hp-4.4-4: the session of a frame; answers where it is unknown here.
  private knownSession(header: Header, peer: Peer, now: number): Session | undefined {
    const session = this.sessions.get(header.session);
    const isHere =
      session !== undefined &&
      (this.medium === "stream" || session.lane === this.laneOf(header, peer));
    if (!isHere) {
      if (this.medium === "datagram" && !this.strangers.admit(peer, now)) {
        this.drop("rate_limited");
      } else if (session === undefined) {
        this.drop("unknown_session");
        this.refuse(header, Status.unknown_session, peer, now);
      } else if ((header.flags & Flag.noReply) === 0) {
        this.refuse(header, Status.wrong_band, peer, now);
      }
      return undefined;
    }
    if (session.peer.key !== peer.key) {
      this.drop("foreign_address"); // hp-5.1-4
      return undefined;
    }
    return session;
  }

  // For frames that are not answered where their session is unknown.
  private ownSession(header: Header, peer: Peer): Session | undefined {
    const session = this.sessions.get(header.session);
    if (
      session === undefined ||
      (this.medium === "datagram" && session.lane !== this.laneOf(header, peer))
    ) {
      this.drop("unknown_session");
      return undefined;
    }
    if (session.peer.key !== peer.key) {
      this.drop("foreign_address");
      return undefined;
    }
    return session;
  }

  private onClose(header: Header, payload: Uint8Array, peer: Peer): void {
    if (payload.length > 0) return this.drop("bad_payload"); // hp-4.5-3
    const session = this.ownSession(header, peer);
    if (session !== undefined) this.endSession(session);
  }

  private endSession(session: Session): void {
    for (const slot of session.slots) {
      if (slot === undefined) continue;
      this.cancelSlot(slot);
      this.freeStream(slot);
      this.freeLarge(slot);
    }
    this.sessions.delete(session.id);
  }

  /** The connection is gone: its session ends. */
  endConnection(peer: Peer): void {
    this.laneOfConnection.delete(peer.key);
    for (const session of this.sessionsOf(peer)) this.endSession(session);
  }

  /** Ends the sessions of a peer with CLOSE. */
  closePeer(peer: Peer, now: number): void {
    for (const session of this.sessionsOf(peer)) this.closeSession(session, now);
  }

  /** Ends all sessions with CLOSE, as the server stops (hp-4.5-2). */
  closeAll(now: number): void {
    for (const session of [...this.sessions.values()]) this.closeSession(session, now);
  }

  private closeSession(session: Session, now: number): void {
    const header = newHeader(FrameKind.CLOSE, this.bandOf(session.lane).low, 0);
    header.session = session.id;
    header.senderTimeNs = BigInt(Math.trunc(now));
    this.send(session.peer, frameOf(header));
    this.endSession(session);
  }

  /** Stream medium: answers the first frame of a connection for which no place is free. */
  turnAway(frame: Uint8Array, peer: Peer, now: number): void {
    const header = readFrame(frame, this.medium);
    if (typeof header === "string") return this.drop(header);
    if (header.kind !== FrameKind.HELLO) return this.drop("unknown_session");
    const hello = readHello(frame.subarray(headerSize));
    if (hello === undefined) return;
    const fault = this.faultOf(header, hello, this.laneOf(header, peer));
    this.refuse(header, fault ?? Status.overload, peer, now);
  }

  // ---- calls -----------------------------------------------------------------------------------

  private onCall(header: Header, payload: Uint8Array, peer: Peer, now: number): void {
    const session = this.knownSession(header, peer, now);
    if (session === undefined) return;
    session.lastHeard = now;
    const slot = session.slots[header.callId % callWindow];
    if (slot !== undefined) {
      if (slot.callId === header.callId) return this.onCopy(header, payload, session, slot, now);
      const distance = ahead(header.callId, slot.newestCallId);
      if (distance < 0) return this.drop("stale_call"); // hp-5.2-2
      slot.newestCallId = header.callId;
      // hp-5.2-3, hp-5.2-4: a call that nobody waits for does not hold its place.
      const isLate = slot.stream === undefined && now >= (slot.request?.deadline ?? now);
      const isAwaited = !slot.isUnawaited && !isLate;
      const isTaken = slot.state === "running" && (isAwaited || slot.large !== undefined);
      if (distance === 0 || isTaken) {
        // hp-5.8-1
        if ((header.flags & Flag.noReply) === 0) this.refuse(header, Status.overload, peer, now);
        return;
      }
      this.freeStream(slot);
      this.freeLarge(slot);
    }
    this.admit(header, payload, session, now);
  }

  // hp-5.2-1: a copy never runs.
  private onCopy(
    header: Header,
    payload: Uint8Array,
    session: Session,
    slot: Slot,
    now: number,
  ): void {
    const { peer } = session;
    if (slot.isEvicted) return this.refuse(header, Status.overload, peer, now); // hp-5.6-10
    if ((header.flags & Flag.noReply) !== 0) {
      return this.drop(slot.state === "done" ? "stale_call" : "duplicate_running");
    }
    if (slot.state === "receiving") return this.onFragment(header, payload, session, slot, now);
    if (slot.state === "running" && !slot.isReplied) {
      if (slot.stream !== undefined) this.extend(slot.stream, session, header, now);
      if ((header.flags & Flag.ackWanted) === 0) return this.drop("duplicate_running");
      // hp-5.6-4
      const count = slot.stream?.items.count ?? 0;
      return this.acknowledge(header, ackOfAll(header.fragmentCount), count, peer, now);
    }
    if (slot.large?.outgoing !== undefined) {
      slot.large.heard = now;
      slot.large.outgoing.nudge();
      return this.sendFragments(slot.large, peer, now);
    }
    if (slot.reply === undefined) return this.drop("stale_call");
    this.sendKept(slot.reply, peer);
  }

  private sendKept(reply: Uint8Array, peer: Peer): void {
    markRepeated(reply);
    this.send(peer, reply);
  }

  // The first frame of a new call.
  private admit(header: Header, payload: Uint8Array, session: Session, now: number): void {
    const deadline = this.deadlineOf(session, header, now);
    const request = new Request(header, payload, session.peer, now, deadline);
    const slot: Slot = {
      state: "running",
      isUnawaited: (header.flags & Flag.noReply) !== 0,
      isEvicted: false,
      isReplied: false,
      callId: header.callId,
      newestCallId: header.callId,
      request,
    };
    session.slots[header.callId % callWindow] = slot;
    const refuse = (status: number): void => {
      this.counters.refusedCount += 1;
      this.complete(request, status, noBytes, now); // hp-5.1-5
    };
    if (header.messageSize > this.messageSizeMax) return refuse(Status.too_large);
    if (!contains(this.bandOf(session.lane), header.priority)) return refuse(Status.wrong_band);
    const isPing = header.service === sessionService && header.method === SessionMethod.ping;
    if (header.priority > this.ceiling && !isPing) return refuse(Status.priority_not_allowed);
    if (deadline <= now) return this.expire(request, now); // hp-5.4-3
    if (header.fragmentCount === 1) return this.dispatch(request, session, slot);
    const place = this.placeFor(session.peer, now);
    if (!place) return refuse(Status.overload);
    slot.state = "receiving";
    const incoming = new IncomingMessage(header);
    const { peer } = session;
    slot.large = { owner: slot, peer, deadline, heard: now, incoming, isComplete: false };
    this.large.add(slot.large);
    this.onFragment(header, payload, session, slot, now);
  }

  private expire(request: Request, now: number): void {
    this.counters.expiredCount += 1;
    this.complete(request, Status.expired, noBytes, now);
  }

  private dispatch(request: Request, session: Session, slot: Slot): void {
    if (request.wantsStream && !this.beginStream(request, session, slot)) {
      this.counters.refusedCount += 1;
      this.complete(request, Status.overload, noBytes, request.received);
      return;
    }
    this.events.push({ kind: "run", request });
  }

  // hp-5.4-2
  private deadlineOf(session: Session, header: Header, now: number): number {
    const budget = header.budgetUs * microsecond;
    const sent = Number(header.senderTimeNs);
    return session.hasOurClock && sent <= now ? sent + budget : now + budget;
  }

  // undefined once it is completed, its session ended, or another call has its place.
  private slotOf(request: Request): Slot | undefined {
    const session = this.sessions.get(request.header.session);
    const slot = session?.slots[request.header.callId % callWindow];
    return slot?.request === request && slot.state === "running" ? slot : undefined;
  }

  /** The largest reply that the request's caller takes, in bytes. */
  replySizeMax(request: Request): number {
    const session = this.sessions.get(request.header.session);
    return Math.min(this.messageSizeMax, session?.messageSizeMax ?? Infinity);
  }

  /** Answers a request that wantsReceipt before it runs; ok: it will (hp-5.8-3). */
  accept(request: Request, status: number, now: number): void {
    const slot = this.slotOf(request);
    if (slot === undefined || slot.isUnawaited) return;
    slot.isUnawaited = true;
    this.writeReply(request, slot, status, noBytes, now);
  }

  /**
   * Ends a request. Nothing is sent for one that wants no reply, was cancelled, or whose session
   * ended, which is counted. A reply that is too large for its caller is one of too_large.
   */
  complete(request: Request, status: number, payload: Uint8Array, now: number): void {
    const slot = this.slotOf(request);
    if (slot === undefined) {
      this.counters.orphanedCount += 1;
      return;
    }
    this.freeLarge(slot);
    if (!slot.isUnawaited && payload.length > this.replySizeMax(request)) {
      status = Status.too_large;
      payload = noBytes;
    }
    const isLarge = payload.length > this.payloadMax && !slot.isUnawaited;
    if (isLarge && !this.placeFor(request.peer, now)) {
      // hp-5.6-5: the method ran, so that no status could take the reply's place.
      this.waitingReplies.push({ request, status, payload });
      return;
    }
    slot.state = "done";
    if (!slot.isUnawaited) this.writeReply(request, slot, status, payload, now);
    this.sendWaiting(now);
  }

  private sendWaiting(now: number): void {
    if (!this.large.hasFreed) return;
    this.large.hasFreed = false;
    const waiting = this.waitingReplies;
    this.waitingReplies = [];
    for (const { request, status, payload } of waiting) {
      // After the deadline nobody waits for the reply.
      if (request.deadline > now) {
        this.complete(request, status, payload, now);
      } else {
        const slot = this.slotOf(request);
        if (slot !== undefined) slot.state = "done";
      }
    }
  }

  private writeReply(
    request: Request,
    slot: Slot,
    status: number,
    payload: Uint8Array,
    now: number,
  ): void {
    const header = headerAbout(request.header, FrameKind.REPLY, payload.length, now); // hp-5.1-2
    header.status = status;
    const took = Math.trunc((now - request.received) / microsecond);
    header.budgetUs = Math.min(Math.max(took, 0), budgetUnlimited);
    if (slot.stream !== undefined) {
      header.item = slot.stream.items.count; // hp-5.10-6
      if (slot.stream.items.isAcknowledged()) this.freeStream(slot);
    }
    if (payload.length > this.payloadMax) {
      const window = fragmentWindow(this.medium);
      const outgoing = new OutgoingMessage(header, payload, this.payloadMax, window);
      const { peer, deadline } = request;
      slot.large = { owner: slot, peer, deadline, heard: now, isComplete: true, outgoing };
      this.large.add(slot.large);
      this.sendFragments(slot.large, peer, now);
      return;
    }
    const frame = frameOf(header, payload);
    slot.isReplied = true;
    if (this.medium === "datagram") slot.reply = frame;
    this.send(request.peer, frame);
  }

  private onCancel(header: Header, payload: Uint8Array, peer: Peer, now: number): void {
    const session = this.ownSession(header, peer);
    if (session === undefined) return;
    if (payload.length > 0) return this.drop("bad_payload"); // hp-5.9-1
    session.lastHeard = now;
    const index = header.callId % callWindow;
    const slot = session.slots[index];
    if (slot?.callId === header.callId) {
      if (slot.state !== "done") this.counters.cancelledCount += 1;
      this.cancelSlot(slot);
      this.freeStream(slot);
      if (slot.state !== "running") this.freeLarge(slot);
      if (slot.state === "receiving") slot.state = "done";
      return;
    }
    // hp-5.9-2: the CANCEL overtook its call, which does not run when it comes.
    if (slot !== undefined && ahead(header.callId, slot.newestCallId) <= 0) {
      return this.drop("stale_call");
    }
    this.counters.cancelledCount += 1;
    if (slot?.state === "running") {
      slot.newestCallId = header.callId;
      return;
    }
    if (slot !== undefined) {
      this.freeStream(slot);
      this.freeLarge(slot);
    }
    session.slots[index] = {
      state: "done",
      isUnawaited: false,
      isEvicted: false,
      isReplied: false,
      callId: header.callId,
      newestCallId: header.callId,
    };
  }

  private cancelSlot(slot: Slot): void {
    if (slot.state !== "running" || slot.isUnawaited) return;
    slot.isUnawaited = true;
    if (slot.request !== undefined) this.events.push({ kind: "cancelled", request: slot.request });
  }

  // ---- large messages --------------------------------------------------------------------------

  private freeLarge(slot: Slot): void {
    if (slot.large === undefined) return;
    this.large.free(slot.large);
    delete slot.large;
  }

  // Makes a place for a large message; false if none can be had.
  private placeFor(peer: Peer, now: number): boolean {
    const place = this.large.find(peer, now);
    if (place === undefined || place === "free") return place === "free";
    const slot = place.owner;
    // hp-5.6-10: later fragments of it are refused while its caller waits.
    slot.isEvicted = slot.state === "receiving" && place.deadline > now;
    slot.state = "done";
    this.freeLarge(slot);
    return true;
  }

  private onFragment(
    header: Header,
    payload: Uint8Array,
    session: Session,
    slot: Slot,
    now: number,
  ): void {
    const { large } = slot;
    if (large?.incoming === undefined) return this.drop("bad_fragment");
    const taken = large.incoming.take(header, payload);
    if (taken === "foreign") return this.drop("bad_fragment");
    large.heard = now;
    if (taken !== "last") {
      if ((header.flags & Flag.ackWanted) === 0) return;
      return this.acknowledge(header, large.incoming.ack(), 0, session.peer, now);
    }
    large.isComplete = true;
    slot.state = "running";
    const deadline = this.deadlineOf(session, header, now);
    slot.request = new Request(header, large.incoming.message, session.peer, now, deadline);
    if (deadline <= now) return this.expire(slot.request, now);
    this.dispatch(slot.request, session, slot);
  }

  private acknowledge(
    about: Header,
    ack: FragmentAck,
    itemCount: number,
    peer: Peer,
    now: number,
  ): void {
    const payload = writeAck(ack);
    const header = headerAbout(about, FrameKind.ACK, payload.length, now);
    header.item = itemCount;
    this.send(peer, frameOf(header, payload));
  }

  private onAck(header: Header, payload: Uint8Array, peer: Peer, now: number): void {
    const session = this.ownSession(header, peer);
    if (session === undefined) return;
    const ack = readAck(payload);
    if (ack === undefined) return this.drop("bad_payload");
    session.lastHeard = now;
    const slot = session.slots[header.callId % callWindow];
    const large = slot?.large;
    if (slot?.callId !== header.callId || slot.state !== "done" || large?.outgoing === undefined) {
      return this.drop("unexpected");
    }
    large.heard = now;
    large.outgoing.onAck(ack, (header.flags & Flag.ackWanted) !== 0);
    if (large.outgoing.isAcknowledged()) return this.freeLarge(slot); // hp-5.6-8
    this.sendFragments(large, peer, now);
  }

  private sendFragments(large: LargeMessage<Slot>, peer: Peer, now: number): void {
    for (;;) {
      const frame = large.outgoing?.next(0, now);
      if (frame === undefined) return;
      this.send(peer, frame);
    }
  }

  // ---- streams ---------------------------------------------------------------------------------

  private beginStream(request: Request, session: Session, slot: Slot): boolean {
    if (this.streams.size >= this.streamCountMax) return false;
    const fragmentSize = Math.min(this.payloadMax, session.messageSizeMax);
    slot.stream = {
      items: new OutgoingStream(request.header, fragmentSize, this.medium),
      deadline: this.leaseOf(session, request.header, request.received),
      pending: undefined,
    };
    this.streams.set(slot.stream, slot);
    return true;
  }

  private freeStream(slot: Slot): void {
    if (slot.stream === undefined) return;
    this.streams.delete(slot.stream);
    delete slot.stream;
  }

  // hp-5.10-7
  private leaseOf(session: Session, header: Header, now: number): number {
    if (this.medium === "stream" && header.budgetUs === budgetUnlimited) return never;
    const stated = this.deadlineOf(session, header, now);
    return this.medium === "stream" ? stated : Math.min(stated, now + streamLeaseMax);
  }
  private extend(stream: StreamState, session: Session, header: Header, now: number): void {
    stream.deadline = Math.max(stream.deadline, this.leaseOf(session, header, now));
  }

  /**
   * Gives an item of a stream; the core sends what does not go out at once when it may.
   * @returns `no_credit`: nothing was taken, as the client takes no more now, see the event
   *   `credit`; `too_large` for the client; `gone`: nobody waits any more
   */
  pushItem(
    request: Request,
    item: Uint8Array,
    now: number,
  ): "taken" | "no_credit" | "too_large" | "gone" {
    const slot = this.slotOf(request);
    if (slot?.stream === undefined) return "gone";
    if (item.length > this.replySizeMax(request)) return "too_large"; // hp-5.10-10
    if (slot.stream.pending !== undefined) return "no_credit";
    if (!this.pushFrame(slot.stream, item, request.peer, now)) return "no_credit";
    slot.stream.pending = slot.stream.items.isMidway() ? item : undefined;
    this.pushPending(slot.stream, request.peer, now);
    return "taken";
  }

  private pushFrame(stream: StreamState, item: Uint8Array, peer: Peer, now: number): boolean {
    const frame = stream.items.push(item, now);
    if (frame !== undefined) this.send(peer, frame);
    return frame !== undefined;
  }

  private pushPending(stream: StreamState, peer: Peer, now: number): void {
    while (stream.pending !== undefined) {
      if (!this.pushFrame(stream, stream.pending, peer, now)) return;
      if (!stream.items.isMidway()) stream.pending = undefined;
    }
  }

  /** Whether the last item of the request's stream was sent in part only. */
  isItemPending(request: Request): boolean {
    return this.slotOf(request)?.stream?.pending !== undefined;
  }

  private onCredit(header: Header, payload: Uint8Array, peer: Peer, now: number): void {
    const session = this.knownSession(header, peer, now);
    if (session === undefined) return;
    const credit = readCredit(payload);
    if (credit === undefined) return this.drop("bad_payload"); // hp-5.10-8
    session.lastHeard = now;
    const slot = session.slots[header.callId % callWindow];
    const isAsked = (header.flags & Flag.ackWanted) !== 0;
    const isKnown = slot?.callId === header.callId;
    if (!isKnown || (slot.stream === undefined && !slot.isReplied)) {
      if (!isAsked) return this.drop("unexpected");
      return this.refuse(header, Status.lost, peer, now); // hp-5.10-7
    }
    const { stream } = slot;
    let isRepaired = false;
    if (stream !== undefined) {
      this.extend(stream, session, header, now);
      stream.items.onCredit(credit, header.item, isAsked);
      for (let frame = stream.items.nextRepair(); frame !== undefined;) {
        this.send(peer, frame);
        isRepaired = true;
        frame = stream.items.nextRepair();
      }
      if (slot.isReplied && stream.items.isAcknowledged()) this.freeStream(slot);
    }
    // hp-5.10-5
    if (isAsked && slot.reply !== undefined) {
      this.sendKept(slot.reply, peer);
    } else if (isAsked && !isRepaired && slot.stream !== undefined) {
      this.acknowledge(header, ackOfAll(1), slot.stream.items.count, peer, now);
    }
    if (stream === undefined || slot.state !== "running" || slot.request === undefined) return;
    this.pushPending(stream, peer, now);
    if (stream.pending === undefined) this.events.push({ kind: "credit", request: slot.request });
  }
}

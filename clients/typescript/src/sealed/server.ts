import { ahead, areEqual, isZero, plainBytes, toHex, viewOf } from "../core/bytes.js";
import { CookieJar } from "../core/cookie.js";
import { FrameCounters } from "../core/counters.js";
import { cookieSize, helloSize, readHello, readWelcome, type Welcome } from "../core/handshake.js";
import {
  frameOf,
  headerAbout,
  newHeader,
  readFrame,
  readHeader,
  type Header,
} from "../core/header.js";
import {
  FrameKind,
  Status,
  budgetUnlimited,
  contains,
  headerSize,
  microsecond,
  millisecond,
  never,
  second,
  sessionIdleMin,
  type DropReason,
  type Medium,
} from "../core/numbers.js";
import { StrangerLimit, shareOfOneHost, type Peer } from "../core/peer.js";
import type { Outgoing, ServerSessions } from "../core/server_sessions.js";
import type { Algorithms, KeyPair } from "./algorithms.js";
import * as frames from "./frames.js";
import { Responder } from "./noise.js";
import { SealedSession } from "./session.js";

export interface SealedServerConfig {
  readonly algorithms: Algorithms;
  readonly medium: Medium;
  readonly own: KeyPair;
  readonly preshared?: Uint8Array;
  /** Whether the server admits a client of that key. */
  readonly admits: (clientKey: Uint8Array, peer: Peer) => boolean;
  /** Whether clients without a key get sessions, too; default: no. */
  readonly takesUnsealed?: boolean;
  /** As the sessions'; default 256. */
  readonly sessionCountMax?: number;
}

interface Entry {
  readonly id: bigint;
  readonly peer: Peer;
  readonly clientEpoch: bigint;
  readonly channel: bigint;
  readonly handshakeNumber: number;
  readonly clientKey: Uint8Array;
  readonly helloHash: string;
  readonly welcome: Uint8Array;
  readonly granted: Welcome;
  readonly seal: SealedSession;
  readonly hasOurClock: boolean;
  readonly opened: number;
  lastHeard: number;
  isConfirmed: boolean;
  // sec-6.1: the smallest arrival − sender_time_ns, when it was, and the last frame in time.
  fastest: bigint | undefined;
  fastestAt: number;
  inTimeAt: number;
}

const halfOpenMax = 2 * second; // sec-6-1
const endedMemory = 2 * sessionIdleMin; // hp-5.5-2: clients judge by the state 30 s ago
const lateTolerance = millisecond;
const stillClock = 10 * second;
const driftDivisor = 5000; // 200 ppm

/**
 * Stands between ServerSessions and their transport, and seals sessions (spec/security.md). The
 * sessions' framePayloadMax is sealedPayloadMax(). Give received frames to onFrame(), and each
 * frame of the sessions to seal(); send what takeFrames() has besides.
 */
export class SealedServer {
  readonly counters = new FrameCounters();
  private readonly entries = new Map<bigint, Entry>();
  private readonly cookies: CookieJar;
  private readonly handshakes: StrangerLimit;
  private readonly allHandshakes: StrangerLimit;
  private readonly sessionCountMax: number;
  private frames: Outgoing[] = [];
  private endedUntil = 0;

  constructor(
    private readonly config: SealedServerConfig,
    private readonly sessions: ServerSessions,
  ) {
    const { random } = config.algorithms;
    this.cookies = new CookieJar(random(new Uint8Array(16)));
    this.handshakes = new StrangerLimit(random(new Uint8Array(1)), 32, 20 * millisecond);
    this.allHandshakes = new StrangerLimit(new Uint8Array(1), 256, 2 * millisecond);
    this.sessionCountMax = config.sessionCountMax ?? 256;
  }

  /** Frames of handshakes to send; the sessions have theirs. */
  takeFrames(): Outgoing[] {
    const frames = this.frames;
    this.frames = [];
    return frames;
  }
  /** The key of a session's client; undefined if the session is not sealed. */
  clientKeyOf(session: bigint): Uint8Array | undefined {
    return this.find(session)?.clientKey;
  }
  get halfOpenCount(): number {
    return [...this.entries.values()].filter((entry) => !entry.isConfirmed).length;
  }

  /**
   * Handles a received frame. Returns true if the connection is to be ended (sec-5-7).
   * @param frame  untrusted; one whole frame
   */
  onFrame(frame: Uint8Array, peer: Peer, now: number): boolean {
    frame = plainBytes(frame);
    if (frames.isSealed(frame)) return this.onSealed(frame, peer, now);
    const header = readFrame(frame, this.config.medium);
    if (typeof header !== "string") {
      if (header.kind === FrameKind.HELLO) return this.onHello(header, frame, peer, now);
      if (this.find(header.session) !== undefined) return this.drop("unsealed"); // sec-4-4
    }
    this.sessions.onFrame(frame, peer, now);
    return false;
  }

  /** Seals a frame of the sessions, at the time of sending; undefined if nothing may go out. */
  seal(frame: Uint8Array): Uint8Array | undefined {
    const header = readHeader(frame);
    if (typeof header === "string") return undefined;
    const { COOKIE, WELCOME, REFUSE } = FrameKind;
    if (header.kind === WELCOME || header.kind === COOKIE) return frame;
    const entry = this.entries.get(header.session);
    if (entry !== undefined) {
      const sealed = entry.seal.seal(frames.sealedHeader(frame), frame.subarray(headerSize));
      if (header.kind === FrameKind.CLOSE) this.entries.delete(entry.id);
      return sealed;
    }
    const mayGo = this.config.takesUnsealed === true || header.kind === REFUSE;
    return mayGo ? frame : undefined;
  }

  /** Ends half-open sessions whose time is over (sec-6-1). */
  onTime(now: number): void {
    for (const entry of [...this.entries.values()]) {
      if (this.find(entry.id) === undefined) continue;
      if (!entry.isConfirmed && now - entry.opened > halfOpenMax) this.close(entry, now);
    }
  }
  nextTime(): number {
    let next = never;
    for (const entry of this.entries.values()) {
      if (!entry.isConfirmed) next = Math.min(next, entry.opened + halfOpenMax + 1);
    }
    return next;
  }

  /** Ends the sessions of keys that are no longer admitted; call it when grants change. */
  review(now: number): void {
    for (const entry of [...this.entries.values()]) {
      if (this.find(entry.id) === undefined) continue;
      if (this.config.admits(entry.clientKey, entry.peer)) continue;
      const header = newHeader(FrameKind.CLOSE, entry.granted.band.low, 0);
      header.session = entry.id;
      header.senderTimeNs = BigInt(Math.trunc(now));
      const frame = entry.seal.seal(frames.sealedHeader(frameOf(header)), new Uint8Array(0));
      if (frame !== undefined) this.frames.push({ frame, peer: entry.peer });
      this.end(entry, now);
    }
  }

  // ---- frames of sessions ----------------------------------------------------------------------

  private find(session: bigint): Entry | undefined {
    const entry = this.entries.get(session);
    if (entry === undefined || this.sessions.isKnown(session)) return entry;
    this.entries.delete(session);
    return undefined;
  }

  // Ends a session in the name of its client.
  private close(entry: Entry, now: number): void {
    const header = newHeader(FrameKind.CLOSE, entry.granted.band.low, 0);
    header.session = entry.id;
    this.sessions.onFrame(frameOf(header), entry.peer, now);
    this.entries.delete(entry.id);
  }

  // sec-6-6: its client may still use it, and its calls may have run.
  private end(entry: Entry, now: number): void {
    this.endedUntil = now + endedMemory;
    this.close(entry, now);
  }

  private drop(reason: DropReason, isFatal = false): boolean {
    this.counters.receivedCount += 1;
    this.counters.drop(reason);
    return isFatal && this.config.medium === "stream";
  }

  // sec-4-2
  private onSealed(frame: Uint8Array, peer: Peer, now: number): boolean {
    const header = frames.readSealedFrame(frame, this.config.medium);
    if (typeof header === "string") return this.drop(header, true);
    const entry = this.find(header.session);
    if (entry === undefined) {
      if (this.sessions.isKnown(header.session)) return this.drop("unexpected");
      // The sessions refuse it, which is a hint for its client (sec-6-2).
      const payload = frame.subarray(headerSize, frame.length - frames.trailerSize);
      this.sessions.onFrame(frames.unsealedFrame(frame, payload), peer, now);
      return false;
    }
    if (entry.peer.key !== peer.key) return this.drop("foreign_address");
    const payload = entry.seal.open(frame);
    if (typeof payload === "string") {
      if (entry.seal.hasEnded) this.end(entry, now);
      return this.drop(payload, true);
    }
    if (!entry.isConfirmed) this.confirm(entry, now);
    entry.lastHeard = now;
    const plain = frames.unsealedFrame(frame, payload);
    if (!this.isHeldBack(entry, header, plain, now)) this.sessions.onFrame(plain, peer, now);
    return false;
  }

  // sec-6-1: only now it takes the place of an earlier session of its channel.
  private confirm(entry: Entry, now: number): void {
    entry.isConfirmed = true;
    for (const other of [...this.entries.values()]) {
      const isOfChannel =
        other !== entry &&
        other.peer.key === entry.peer.key &&
        other.clientEpoch === entry.clientEpoch &&
        other.channel === entry.channel &&
        areEqual(other.clientKey, entry.clientKey);
      if (isOfChannel && ahead(entry.handshakeNumber, other.handshakeNumber) > 0) {
        this.close(other, now);
      }
    }
  }

  // How much later than the fastest frame of its session this one came (sec-6.1), in ns.
  private lateness(entry: Entry, senderTimeNs: bigint, now: number): number {
    const sample = BigInt(Math.trunc(now)) - senderTimeNs;
    const grown = BigInt(Math.trunc((now - entry.fastestAt) / driftDivisor));
    const late = entry.fastest === undefined ? 0n : sample - (entry.fastest + grown);
    if (late <= 0n) {
      entry.fastest = sample;
      entry.fastestAt = now;
    }
    if (late <= BigInt(lateTolerance)) entry.inTimeAt = now;
    return Math.max(Number(late), 0);
  }

  // sec-6.1-1, sec-6.1-2
  private isHeldBack(entry: Entry, header: Header, plain: Uint8Array, now: number): boolean {
    const late = this.lateness(entry, header.senderTimeNs, now) - lateTolerance;
    const isJudged = header.kind === FrameKind.CALL && header.budgetUs !== budgetUnlimited;
    if (!isJudged || late <= 0) return false;
    const left = header.budgetUs * microsecond - late;
    if (left > 0) {
      // On one clock the sessions see it themselves.
      if (!entry.hasOurClock) {
        viewOf(plain).setUint32(40, Math.trunc(left / microsecond), true);
      }
      return false;
    }
    this.counters.receivedCount += 1;
    this.counters.expiredCount += 1;
    if (now - entry.inTimeAt >= stillClock) this.end(entry, now);
    return true;
  }

  // ---- handshakes ------------------------------------------------------------------------------

  private onHello(header: Header, frame: Uint8Array, peer: Peer, now: number): boolean {
    const payload = frame.subarray(headerSize);
    if (payload.length === frames.sealedHelloSize) {
      return this.onSealedHello(header, frame, peer, now);
    }
    const hello = readHello(payload);
    if (hello === undefined) return this.drop("bad_payload");
    if ((hello.features & frames.Feature.sealed) !== 0) {
      return this.giveCookie(header, payload, peer, now);
    }
    // sec-6.2-1, sec-6.2-2
    if (this.config.takesUnsealed !== true || this.hasConfirmedStream(peer)) {
      return this.drop("unsealed");
    }
    this.sessions.onFrame(frame, peer, now);
    return false;
  }

  private hasConfirmedStream(peer: Peer): boolean {
    return (
      this.config.medium === "stream" &&
      [...this.entries.values()].some(
        (entry) =>
          entry.isConfirmed && entry.peer.key === peer.key && this.sessions.isKnown(entry.id),
      )
    );
  }

  // Gives the sessions a HELLO as if it had no message 1; their answer.
  private passHello(header: Header, hello: Uint8Array, peer: Peer, now: number): Outgoing[] {
    const plain = { ...header, payloadSize: helloSize, messageSize: helloSize };
    this.sessions.onFrame(frameOf(plain, hello), peer, now);
    return this.sessions.takeFrames();
  }

  // sec-3.1-1: never opens a session.
  private giveCookie(header: Header, payload: Uint8Array, peer: Peer, now: number): boolean {
    let cookie: Uint8Array;
    let answer: Header | DropReason;
    if (this.config.medium === "datagram") {
      // The sessions count strangers, and refuse what they must.
      const blank = payload.slice(0, helloSize);
      blank.fill(0, 40, 40 + cookieSize);
      const answers = this.passHello(header, blank, peer, now);
      const given = answers[0]?.frame;
      answer = given === undefined ? "unexpected" : readHeader(given);
      if (given === undefined || typeof answer === "string" || answer.kind !== FrameKind.COOKIE) {
        this.frames.push(...answers);
        return false;
      }
      cookie = given.subarray(headerSize);
    } else {
      answer = newHeader(FrameKind.COOKIE, header.priority, 0);
      answer.callId = header.callId;
      answer.senderTimeNs = BigInt(Math.trunc(now));
      // Not zero, so that the next HELLO shows that there was a COOKIE.
      cookie = this.cookies.give(peer.key, viewOf(payload).getBigUint64(8, true), now);
    }
    answer.payloadSize = answer.messageSize = frames.sealedCookieSize;
    const sealed = this.cookieOf(cookie);
    this.frames.push({ frame: frameOf(answer, sealed), peer });
    return false;
  }

  private cookieOf(cookie: Uint8Array): Uint8Array {
    const { algorithms, own } = this.config;
    const { suites } = algorithms;
    return frames.writeSealedCookie({ cookie, serverKey: own.publicKey, suites });
  }

  private onSealedHello(header: Header, frame: Uint8Array, peer: Peer, now: number): boolean {
    const payload = frame.subarray(headerSize);
    const read = frames.readSealedHello(payload);
    if (read === undefined) return this.drop("bad_payload");
    const { hello } = read;
    // sec-3.2-2: before any work with keys.
    const hasSuite = (this.config.algorithms.suites & frames.suiteOf(hello.features)) !== 0;
    const isStream = this.config.medium === "stream";
    const isProven =
      isStream || this.sessions.cookies.isGood(hello.cookie, peer.key, hello.clientEpoch, now);
    if (!hasSuite || !isProven) {
      if (!isProven) this.counters.drop("bad_cookie");
      return this.giveCookie(header, payload, peer, now);
    }
    const hash = toHex(this.config.algorithms.sha256(frame));
    for (const entry of this.entries.values()) {
      const isOfChannel =
        entry.peer.key === peer.key &&
        entry.clientEpoch === hello.clientEpoch &&
        entry.channel === hello.channel &&
        this.sessions.isKnown(entry.id);
      if (!isOfChannel) continue;
      if (entry.helloHash === hash) {
        this.frames.push({ frame: entry.welcome, peer }); // sec-3-3
        return false;
      }
      // hp-4.1-6
      if (ahead(header.callId, entry.handshakeNumber) < 0) return this.drop("unexpected");
    }
    if (
      !this.handshakes.admit(peer, now) ||
      !this.allHandshakes.admit({ key: "", host: "" }, now)
    ) {
      return this.drop("rate_limited", true);
    }
    return this.answerMessage1(header, frame, read, hash, peer, now);
  }

  private answerMessage1(
    header: Header,
    frame: Uint8Array,
    read: NonNullable<ReturnType<typeof frames.readSealedHello>>,
    hash: string,
    peer: Peer,
    now: number,
  ): boolean {
    const { algorithms, own, preshared, medium } = this.config;
    const { hello, message } = read;
    const helloBytes = frame.slice(headerSize, headerSize + helloSize);
    // sec-3.4-1: over a stream there may have been no COOKIE.
    const hasCookie = medium === "datagram" || !isZero(hello.cookie);
    const cookie = hasCookie ? this.cookieOf(hello.cookie) : undefined;
    const suite = frames.suiteOf(hello.features);
    const responder = new Responder({
      algorithms,
      suite,
      own,
      preshared: preshared ?? new Uint8Array(32),
      prologue: frames.prologueOf(header.priority, header.callId, helloBytes, cookie),
    });
    const client = responder.readMessage1(message);
    if (client === undefined) return this.drop("bad_seal"); // sec-3.2-2
    const refuse = (status: number): boolean => {
      this.counters.refusedCount += 1;
      const refusal = headerAbout(header, FrameKind.REFUSE, 0, now);
      refusal.service = refusal.method = 0;
      refusal.traceId = 0n;
      refusal.status = status;
      this.frames.push({ frame: frameOf(refusal), peer });
      return false;
    };
    if (!this.config.admits(client.clientKey, peer)) return refuse(Status.not_allowed);
    const formerId = viewOf(client.payload).getBigUint64(0, true);
    const former = this.find(formerId);
    const isAlive =
      former !== undefined &&
      areEqual(former.clientKey, client.clientKey) &&
      former.peer.key === peer.key &&
      contains(former.granted.band, header.priority);
    if (isAlive) {
      // sec-6-3: no session is opened.
      const welcome = { ...former.granted, features: hello.features };
      const inside = { session: former.id, welcome, former: frames.Former.alive };
      const written = responder.writeMessage2(frames.writeSealedWelcome(inside));
      if (written === undefined) return this.drop("bad_seal");
      this.frames.push({ frame: this.welcomeOf(header, former.id, written.message, now), peer });
      return false;
    }
    // hp-4-4: this HELLO would end the connection's session.
    if (this.hasConfirmedStream(peer)) return this.drop("unexpected");
    if (!this.makeSpace(client.clientKey, now)) return refuse(Status.overload);
    // sec-6-1: for the sessions each handshake is a channel of its own, so that it replaces none.
    const ownChannel = helloBytes.slice();
    ownChannel.set(algorithms.sha256(frame).subarray(0, 8), 16);
    const answers = this.passHello(header, ownChannel, peer, now);
    const given = answers[0]?.frame ?? new Uint8Array(0);
    const answer = readHeader(given);
    const granted = readWelcome(given.subarray(headerSize));
    if (typeof answer === "string" || granted === undefined) {
      this.frames.push(...answers);
      return false;
    }
    const welcome = { ...granted, features: hello.features };
    const { ended, gone, none } = frames.Former;
    const became = formerId === 0n ? none : now < this.endedUntil ? ended : gone;
    const inside = { session: answer.session, welcome, former: became };
    const written = responder.writeMessage2(frames.writeSealedWelcome(inside));
    if (written === undefined) return this.drop("bad_seal");
    const keys = { send: written.keys.server, receive: written.keys.client };
    const entry: Entry = {
      id: answer.session,
      peer,
      clientEpoch: hello.clientEpoch,
      channel: hello.channel,
      handshakeNumber: header.callId,
      clientKey: client.clientKey,
      helloHash: hash,
      welcome: this.welcomeOf(header, answer.session, written.message, now),
      granted: welcome,
      seal: new SealedSession(algorithms, suite, keys, medium === "stream"),
      hasOurClock: hello.clockDomain !== 0n && hello.clockDomain === granted.clockDomain,
      opened: now,
      lastHeard: now,
      isConfirmed: false,
      fastest: undefined,
      fastestAt: now,
      inTimeAt: now,
    };
    this.entries.set(entry.id, entry);
    this.frames.push({ frame: entry.welcome, peer });
    return false;
  }

  private welcomeOf(about: Header, session: bigint, message: Uint8Array, now: number): Uint8Array {
    const header = newHeader(FrameKind.WELCOME, about.priority, message.length);
    header.callId = about.callId;
    header.session = session;
    header.senderTimeNs = BigInt(Math.trunc(now));
    return frameOf(header, message);
  }

  // sec-6-1, sec-6-7: quotas of half-open sessions, and of one key.
  private makeSpace(clientKey: Uint8Array, now: number): boolean {
    this.onTime(now);
    const isOwn = (entry: Entry): boolean => areEqual(entry.clientKey, clientKey);
    const halfOpenCountMax = Math.max(1, Math.floor(this.sessionCountMax / 4));
    this.replaceOldest(shareOfOneHost(halfOpenCountMax), isOwn, now);
    this.replaceOldest(halfOpenCountMax, () => true, now);
    const own = [...this.entries.values()].filter(isOwn);
    if (own.length < shareOfOneHost(this.sessionCountMax)) return true;
    const [silent] = own.sort((a, b) => a.lastHeard - b.lastHeard);
    if (silent === undefined || now - silent.lastHeard < sessionIdleMin) return false;
    this.close(silent, now);
    return true;
  }

  private replaceOldest(limit: number, isMeant: (entry: Entry) => boolean, now: number): void {
    const halfOpen = [...this.entries.values()].filter(
      (entry) => !entry.isConfirmed && isMeant(entry),
    );
    const oldest = halfOpen[0]; // a Map keeps the order of insertion
    if (halfOpen.length >= limit && oldest !== undefined) this.close(oldest, now);
  }
}

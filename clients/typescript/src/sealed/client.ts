import { areEqual, isZero, plainBytes, toHex, viewOf } from "../core/bytes.js";
import { FrameCounters } from "../core/counters.js";
import { cookieSize, helloSize, writeWelcome, type Welcome } from "../core/handshake.js";
import {
  frameOf,
  newHeader,
  readFrame,
  readHeader,
  writeHeader,
  type Header,
} from "../core/header.js";
import {
  FrameKind,
  Status,
  contains,
  headerSize,
  millisecond,
  second,
  type DropReason,
  type Medium,
} from "../core/numbers.js";
import { Suite, type Algorithms, type KeyPair } from "./algorithms.js";
import * as frames from "./frames.js";
import { Initiator } from "./noise.js";
import { SealedSession } from "./session.js";

export interface SealedClientConfig {
  readonly algorithms: Algorithms;
  readonly medium: Medium;
  readonly own: KeyPair;
  /** The server's key, from our own configuration (sec-2-4). */
  readonly serverKey: Uint8Array;
  /** 32 bytes that both sides are configured with; none if absent. */
  readonly preshared?: Uint8Array;
  /** Random for each life of the program (hp-4-2). */
  readonly handshakeNumber?: number;
}

const callIdAt = 16;
const featuresAt = headerSize + 4;
const cookieAt = headerSize + 40;

/**
 * Stands between a ClientChannel and its transport, and seals the channel's session
 * (spec/security.md). The channel's framePayloadMax is sealedPayloadMax(). After each method, send
 * what takeFrames() has, and give the channel what takeDelivered() has.
 */
export class SealedClient {
  readonly counters = new FrameCounters();
  /** Stream medium: the owner ends the connection (sec-5-7). */
  isBroken = false;
  /** Why the server may not open the session, from frames that anybody may have sent. */
  hint: number | undefined;
  /** The key in the server's COOKIE if it is not the configured one; anybody may have sent it. */
  otherKey: Uint8Array | undefined;
  private frames: Uint8Array[] = [];
  private delivered: Uint8Array[] = [];
  private session: { id: bigint; seal: SealedSession; granted: Welcome } | undefined;
  private next: { id: bigint; seal: SealedSession; granted: Welcome } | undefined;
  private goneSession = 0n;
  // The handshake.
  private isOpening = false;
  private isProbe = false;
  private number: number;
  private channelNumber = 0;
  private suite: Suite;
  private cookie: Uint8Array | undefined;
  private hello = new Uint8Array(headerSize + helloSize);
  private sealedHello: Uint8Array | undefined;
  private initiator: Initiator | undefined;
  // The frame whose refusal a probe looks into, and when the next probe may begin.
  private refused: Header | undefined;
  private nextProbe = 0;
  private probeInterval = 0;

  constructor(private readonly config: SealedClientConfig) {
    this.number = config.handshakeNumber ?? 0;
    this.suite = this.bestSuite(config.algorithms.suites);
  }

  takeFrames(): Uint8Array[] {
    const frames = this.frames;
    this.frames = [];
    return frames;
  }
  takeDelivered(): Uint8Array[] {
    const delivered = this.delivered;
    this.delivered = [];
    return delivered;
  }
  get hasSession(): boolean {
    return this.session !== undefined;
  }

  /** The connection is gone. */
  reset(): void {
    this.session = this.next = this.initiator = this.sealedHello = undefined;
    this.isOpening = false;
    this.goneSession = 0n;
  }

  /** A frame that the channel sends. */
  send(frame: Uint8Array): void {
    const header = readHeader(frame);
    if (typeof header === "string") return;
    if (header.kind === FrameKind.HELLO) return this.sendHello(header, frame);
    const asks = header.kind === FrameKind.CALL || header.kind === FrameKind.CREDIT;
    // The channel learns call by call that the server does not have the session.
    if (asks && header.session === this.goneSession) return this.tellLost(header);
    const { session } = this;
    if (session === undefined || session.id !== header.session) return; // never unsealed
    const sealed = session.seal.seal(frames.sealedHeader(frame), frame.subarray(headerSize));
    if (header.kind === FrameKind.CLOSE) this.session = undefined;
    if (sealed !== undefined) this.frames.push(sealed);
  }

  /** A frame from the transport; untrusted. */
  receive(frame: Uint8Array, now: number): void {
    this.counters.receivedCount += 1;
    frame = plainBytes(frame);
    if (frames.isSealed(frame)) return this.receiveSealed(frame);
    const header = readFrame(frame, this.config.medium);
    if (typeof header === "string") return this.drop(header, true);
    const payload = frame.subarray(headerSize);
    switch (header.kind) {
      case FrameKind.COOKIE:
        return this.onCookie(header, payload);
      case FrameKind.WELCOME:
        return this.onWelcome(header, payload);
      case FrameKind.REFUSE:
        return this.onRefuse(header, now);
      default:
        return this.drop("unsealed"); // sec-4-4, sec-6-2
    }
  }

  private drop(reason: DropReason, isFatal = false): void {
    this.counters.drop(reason);
    if (isFatal && this.config.medium === "stream") this.isBroken = true;
  }

  private receiveSealed(frame: Uint8Array): void {
    const header = frames.readSealedFrame(frame, this.config.medium);
    if (typeof header === "string") return this.drop(header, true);
    if (this.session?.id !== header.session) return this.drop("unexpected", true);
    const payload = this.session.seal.open(frame);
    if (typeof payload === "string") return this.drop(payload, true);
    if (header.kind === FrameKind.CLOSE) this.session = undefined;
    this.delivered.push(frames.unsealedFrame(frame, payload));
  }

  // ---- the handshake ---------------------------------------------------------------------------

  private bestSuite(theirs: number): Suite {
    const both = this.config.algorithms.suites & theirs;
    return (both & Suite.aesGcm) !== 0 ? Suite.aesGcm : Suite.chaChaPoly;
  }

  private beginHandshake(isProbe: boolean): void {
    this.isOpening = true;
    this.isProbe = isProbe;
    this.next = this.cookie = this.sealedHello = this.initiator = undefined;
    this.number = (this.number + 1) >>> 0;
    this.hint = undefined;
  }

  private sendHello(header: Header, frame: Uint8Array): void {
    if (!this.isOpening || this.isProbe || header.callId !== this.channelNumber) {
      this.channelNumber = header.callId;
      const { next } = this;
      if (next !== undefined && contains(next.granted.band, header.priority)) {
        // A probe has opened it already.
        this.session = next;
        this.next = undefined;
        this.hello.set(frame);
        return this.welcomeChannel(header.priority);
      }
      this.beginHandshake(false);
    }
    this.hello.set(frame);
    viewOf(this.hello).setUint32(callIdAt, this.number, true);
    // sec-3-1: a copy is the same bytes.
    if (this.sealedHello !== undefined) {
      this.frames.push(this.sealedHello);
    } else if (this.config.medium === "datagram" && this.cookie === undefined) {
      this.sendFirstHello();
    } else {
      this.sendMessage1();
    }
  }

  private sendFirstHello(): void {
    this.hello.fill(0, cookieAt, cookieAt + cookieSize);
    viewOf(this.hello).setUint32(featuresAt, frames.Feature.sealed, true);
    this.frames.push(this.hello.slice());
  }

  private sendMessage1(): void {
    const features =
      frames.Feature.sealed | (this.suite === Suite.aesGcm ? frames.Feature.aesGcm : 0);
    viewOf(this.hello).setUint32(featuresAt, features, true);
    this.hello.set(this.cookie?.subarray(0, cookieSize) ?? new Uint8Array(cookieSize), cookieAt);
    const header = readHeader(this.hello);
    if (typeof header === "string") return;
    const hello = this.hello.slice(headerSize);
    this.initiator = new Initiator(
      {
        algorithms: this.config.algorithms,
        suite: this.suite,
        own: this.config.own,
        preshared: this.config.preshared ?? new Uint8Array(32),
        prologue: frames.prologueOf(header.priority, header.callId, hello, this.cookie),
      },
      this.config.serverKey,
    );
    // sec-6-3
    const former = new Uint8Array(8);
    const hasFormer = this.session !== undefined && !this.session.seal.hasEnded;
    viewOf(former).setBigUint64(0, hasFormer ? this.session!.id : 0n, true);
    const message = this.initiator.writeMessage1(former);
    if (message === undefined) return; // the configured key is of small order
    header.flags = 0;
    header.payloadSize = header.messageSize = frames.sealedHelloSize;
    const sealed = new Uint8Array(headerSize + frames.sealedHelloSize);
    writeHeader(header, sealed);
    sealed.set(hello, headerSize);
    sealed.set(message, headerSize + helloSize);
    this.sealedHello = sealed;
    this.frames.push(sealed);
  }

  private onCookie(header: Header, payload: Uint8Array): void {
    if (!this.isOpening || header.callId !== this.number) return this.drop("unexpected");
    const cookie = frames.readSealedCookie(payload);
    if (cookie === undefined) {
      // sec-3.1-2
      if (payload.length === cookieSize) this.hint = Status.version_unsupported;
      return this.drop("bad_payload");
    }
    const isOurs = areEqual(cookie.serverKey, this.config.serverKey);
    this.otherKey = isOurs ? undefined : cookie.serverKey;
    if (this.cookie !== undefined && areEqual(payload, this.cookie)) return;
    this.cookie = payload.slice();
    this.sealedHello = undefined;
    this.suite = this.bestSuite(cookie.suites);
    if (this.isProbe || this.config.medium === "stream") return this.sendMessage1();
    // hp-4.2-4: the channel decides whether it answers at once.
    const plain = newHeader(FrameKind.COOKIE, header.priority, cookieSize);
    plain.callId = this.channelNumber;
    this.delivered.push(frameOf(plain, cookie.cookie));
  }

  private onWelcome(header: Header, payload: Uint8Array): void {
    const { initiator, sealedHello } = this;
    if (!this.isOpening || header.callId !== this.number) return this.drop("unexpected");
    if (initiator === undefined || sealedHello === undefined) return this.drop("unexpected");
    if (payload.length !== 112) return this.drop("bad_payload");
    const read = initiator.readMessage2(payload);
    if (read === undefined) return this.drop("bad_seal"); // sec-3-4
    const features = viewOf(sealedHello).getUint32(featuresAt, true);
    const asked = viewOf(sealedHello).getUint16(4, true);
    const inside = frames.readSealedWelcome(read.payload, features);
    this.isOpening = false;
    this.initiator = undefined;
    // sec-3.3-1; the message was authentic, so that the server itself is faulty.
    if (
      inside === undefined ||
      inside.session !== header.session ||
      !contains(inside.welcome.band, asked) ||
      (inside.former === frames.Former.alive && inside.session !== this.session?.id)
    ) {
      return this.drop("bad_payload");
    }
    this.probeInterval = 0;
    if (inside.former === frames.Former.alive) {
      if (!this.isProbe) this.welcomeChannel(asked);
      return;
    }
    const keys = { send: read.keys.client, receive: read.keys.server };
    const isExact = this.config.medium === "stream";
    const seal = new SealedSession(this.config.algorithms, this.suite, keys, isExact);
    const opened = { id: inside.session, seal, granted: inside.welcome };
    if (!this.isProbe) {
      this.session = opened;
      return this.welcomeChannel(asked);
    }
    this.next = opened;
    if (this.refused === undefined) return;
    if (inside.former === frames.Former.ended) return this.tellClosed(this.refused);
    this.goneSession = this.refused.session;
    this.session = undefined;
    this.tellLost(this.refused);
  }

  private welcomeChannel(priority: number): void {
    if (this.session === undefined) return;
    const payload = writeWelcome({ ...this.session.granted, features: 0 });
    const header = newHeader(FrameKind.WELCOME, priority, payload.length);
    header.session = this.session.id;
    header.callId = this.channelNumber;
    this.delivered.push(frameOf(header, payload));
  }

  // sec-6-6: for the channel it is the server's CLOSE.
  private tellClosed(about: Header): void {
    const header = newHeader(FrameKind.CLOSE, about.priority, 0);
    header.session = about.session;
    this.session = undefined;
    this.delivered.push(frameOf(header));
  }

  private tellLost(about: Header): void {
    const header = newHeader(FrameKind.REFUSE, about.priority, 0);
    header.session = about.session;
    header.callId = about.callId;
    header.status = Status.unknown_session;
    this.delivered.push(frameOf(header));
  }

  // sec-6-2: an unsealed REFUSE ends nothing, but is a reason to ask.
  private onRefuse(header: Header, now: number): void {
    this.counters.drop("unsealed");
    if (header.payloadSize !== 0) return;
    if (this.isOpening && !this.isProbe) {
      if (header.callId === this.number && header.session === 0n) this.hint = header.status;
      return;
    }
    const isAboutUs =
      this.session?.id === header.session && header.status === Status.unknown_session;
    if (!isAboutUs || now < this.nextProbe || this.config.medium === "stream") return;
    const doubled = Math.max(2 * this.probeInterval, 100 * millisecond);
    this.probeInterval = Math.min(doubled, second);
    this.nextProbe = now + this.probeInterval;
    this.refused = header;
    this.beginHandshake(true);
    viewOf(this.hello).setUint32(callIdAt, this.number, true);
    this.sendFirstHello();
  }
}

/** How a key is written: `rtpm25519`, a space and Base64 (sec-2). */
export function keyText(key: Uint8Array): string {
  return `rtpm25519 ${btoa(String.fromCharCode(...key))}`;
}

/** The 32 bytes of such a text; undefined if it is none. */
export function parseKey(text: string): Uint8Array | undefined {
  const found = /^rtpm25519 ([A-Za-z0-9+/]{43}=)$/.exec(text.trim());
  if (found?.[1] === undefined) return undefined;
  const key = Uint8Array.from(atob(found[1]), (one) => one.charCodeAt(0));
  return key.length === 32 && !isZero(key) ? key : undefined;
}

/** The fingerprint by which people compare public keys (sec-2). */
export function keyFingerprint(algorithms: Algorithms, key: Uint8Array): string {
  const hex = toHex(algorithms.sha256(key).subarray(0, 10));
  return (hex.match(/..../g) ?? []).join("-");
}

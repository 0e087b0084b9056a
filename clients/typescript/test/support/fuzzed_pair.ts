import assert from "node:assert/strict";
import { ClientChannel, type OpenCall } from "../../src/core/client_channel.js";
import { toHex } from "../../src/core/bytes.js";
import { readFrame } from "../../src/core/header.js";
import { FrameKind, Status, headerSize, millisecond } from "../../src/core/numbers.js";
import type { Medium } from "../../src/core/numbers.js";
import type { Peer } from "../../src/core/peer.js";
import { ServerSessions, type Request } from "../../src/core/server_sessions.js";
import { nodeAlgorithms } from "../../src/node/algorithms.js";
import { newKeyPair } from "../../src/sealed/algorithms.js";
import { SealedClient } from "../../src/sealed/client.js";
import { sealedPayloadMax } from "../../src/sealed/frames.js";
import { SealedServer } from "../../src/sealed/server.js";
import type { Script } from "./script.js";

const clientKeys = newKeyPair(nodeAlgorithms);
const serverKeys = newKeyPair(nodeAlgorithms);
const peer: Peer = { key: "client", host: "client" };
const inFlightMax = 200;
const messageSizeMax = 8192;
const begin = 1000 * millisecond;

interface Begun {
  readonly call: OpenCall;
  readonly request: string;
  readonly isStream: boolean;
  hasEnded: boolean;
}

/** The reply to a request, and an item of it: the request behind a number. */
function answerTo(request: Uint8Array, number: number): Uint8Array {
  return Uint8Array.of(number, ...request);
}

/**
 * A client and a server whose network does what a script says: it loses, repeats, delays and
 * corrupts frames, and makes some up. Neither throws, no call runs or ends twice, nothing is
 * amplified to an unproven address, and what comes is what was sent: with corruption only if sealed.
 */
export class FuzzedPair {
  private readonly client: ClientChannel;
  private readonly server: ServerSessions;
  private readonly sealedClient: SealedClient | undefined;
  private readonly sealedServer: SealedServer | undefined;
  private readonly toServer: Uint8Array[] = [];
  private readonly toClient: Uint8Array[] = [];
  private readonly sentUp: Uint8Array[] = [];
  private readonly sentDown: Uint8Array[] = [];
  private readonly begun = new Map<OpenCall, Begun>();
  private readonly running: Request[] = [];
  private readonly ran = new Set<string>();
  private now = begin;
  private isCorrupt = false;
  private sentCount = 0;
  private randomState = 1;
  /** How many calls ended with their reply, as a sign that scripts get far. */
  replyCount = 0;

  constructor(
    private readonly medium: Medium,
    private readonly isSealed: boolean,
  ) {
    const payload = isSealed ? { framePayloadMax: sealedPayloadMax(medium) } : {};
    this.client = new ClientChannel({
      medium,
      clientEpoch: 1n,
      channel: 1n,
      messageSizeMax,
      ...payload,
    });
    this.server = new ServerSessions({
      medium,
      epoch: 7n,
      random: (bytes) =>
        bytes.map(() => (this.randomState = (this.randomState * 5 + 3) & 0xffff) >> 8),
      sessionCountMax: 2,
      messageSizeMax,
      largeMessageCountMax: 2,
      streamCountMax: 2,
      ...payload,
    });
    if (!isSealed) return;
    const algorithms = nodeAlgorithms;
    const serverKey = serverKeys.publicKey;
    this.sealedClient = new SealedClient({
      algorithms,
      medium,
      own: clientKeys,
      serverKey,
      handshakeNumber: 9,
    });
    const admits = (key: Uint8Array): boolean => toHex(key) === toHex(clientKeys.publicKey);
    this.sealedServer = new SealedServer(
      { algorithms, medium, own: serverKeys, admits, sessionCountMax: 2 },
      this.server,
    );
  }

  run(script: Script): void {
    this.client.open(0, this.now + 5000 * millisecond, this.now);
    this.flush();
    // Most scripts begin behind the handshake.
    if (script.below(8) !== 0) this.deliverAll();
    while (script.hasMore) this.step(script);
    this.end();
  }

  private step(script: Script): void {
    switch (script.below(16)) {
      case 0:
      case 11:
        return this.call(script);
      case 1:
      case 2:
      case 12:
      case 13:
        return this.deliverAll();
      case 3:
        return this.deliver(script);
      case 4:
        return this.corrupt(script);
      case 5:
        return this.invent(script);
      case 6:
      case 14:
        return this.complete(script);
      case 7:
        return this.giveItem(script);
      case 8:
        return this.readItems();
      case 9:
        return this.cancel(script);
      case 10:
        return this.wait(script.byte() * millisecond);
      case 15:
        return this.repeat(script);
      default:
        return this.disturb(script);
    }
  }

  private call(script: Script): void {
    if (!this.client.isReady) {
      // A connection is a new one for each session.
      if (this.begun.size === 0) this.deliverAll();
      return;
    }
    const kind = script.below(4);
    const size = script.below(3) === 0 ? 20 * script.byte() : script.byte();
    const request = new Uint8Array(size).fill(script.byte());
    const call = this.client.call(
      {
        service: 1,
        method: 1,
        priority: 0,
        deadline: this.now + (1 + script.byte()) * 20 * millisecond,
        ...(kind === 1 ? { delivery: "receipt" } : kind === 2 ? { delivery: "sent" } : {}),
        ...(kind === 3 ? { streamWindow: 1 + script.below(32) } : {}),
      },
      request,
      this.now,
    );
    if (typeof call !== "string" && call.isOpen) {
      const isStream = kind === 3;
      this.begun.set(call, { call, request: toHex(request), isStream, hasEnded: false });
    }
    this.flush();
  }

  private deliverAll(): void {
    for (let i = 0; i < 50 && this.toServer.length + this.toClient.length > 0; i += 1) {
      const up = this.toServer.shift();
      if (up !== undefined) this.feedServer(up);
      const down = this.toClient.shift();
      if (down !== undefined) this.feedClient(down);
    }
  }

  // Out of order, twice, or not at all; a stream medium does neither.
  private deliver(script: Script): void {
    const isUp = script.below(2) === 0;
    const frames = isUp ? this.toServer : this.toClient;
    const how = this.medium === "stream" ? 0 : script.below(3);
    const at = this.medium === "stream" ? 0 : script.below(frames.length);
    const [frame] = how === 1 ? frames.slice(at, at + 1) : frames.splice(at, 1);
    if (frame === undefined || how === 2) return;
    if (isUp) this.feedServer(frame);
    else this.feedClient(frame);
  }

  // A frame that was on its way for long.
  private repeat(script: Script): void {
    if (this.medium === "stream") return;
    const isUp = script.below(4) !== 0;
    const frames = isUp ? this.sentUp : this.sentDown;
    const frame = frames[script.below(frames.length)];
    if (frame === undefined) return;
    if (isUp) this.feedServer(frame.slice());
    else this.feedClient(frame.slice());
  }

  private corrupt(script: Script): void {
    const frames = script.below(2) === 0 ? this.toServer : this.toClient;
    const frame = frames[script.below(frames.length)];
    if (frame === undefined) return;
    this.isCorrupt = true;
    const changed = frame.slice(0, script.below(8) === 0 ? script.byte() : frame.length);
    for (let i = script.below(3); i >= 0; i -= 1) {
      const at = script.below(2) === 0 ? script.below(headerSize) : script.number() % frame.length;
      if (at < changed.length) changed[at] = script.byte();
    }
    frames[frames.indexOf(frame)] = changed;
  }

  private invent(script: Script): void {
    this.isCorrupt = true;
    const model = [...this.toServer, ...this.toClient].at(script.below(8));
    const bytes = script.bytes(script.below(80));
    const frame = new Uint8Array(Math.max(bytes.length, model?.length ?? 0));
    frame.set(model ?? bytes);
    const at = 4 + 4 * script.below(14);
    if (model !== undefined && at + 16 <= frame.length) frame.set(bytes.subarray(0, 16), at);
    if (script.below(2) === 0) this.feedServer(frame);
    else this.feedClient(frame);
  }

  private complete(script: Script): void {
    const request = this.running.splice(script.below(this.running.length), 1)[0];
    if (request === undefined) return;
    const isGood = script.below(4) !== 0;
    const status = isGood ? Status.ok : script.below(20);
    const isPlain = status === Status.ok && !request.wantsStream;
    const payload = isPlain ? answerTo(request.payload, 1) : new Uint8Array(0);
    this.server.complete(request, status, payload, this.now);
    this.flush();
  }

  private giveItem(script: Script): void {
    const request = this.running.filter((one) => one.wantsStream)[script.below(2)];
    if (request === undefined) return;
    for (let i = script.below(8); i >= 0; i -= 1) {
      if (this.server.isItemPending(request)) break;
      this.server.pushItem(request, answerTo(request.payload, 2), this.now);
    }
    this.flush();
  }

  private readItems(): void {
    for (const one of this.begun.values()) {
      if (!one.isStream) continue;
      for (let i = 0; i < 40; i += 1) {
        const item = this.client.nextItem(one.call, this.now);
        if (item === undefined) break;
        this.expectWhole(item, one, 2);
      }
    }
    this.flush();
  }

  private cancel(script: Script): void {
    const one = [...this.begun.values()][script.below(this.begun.size)];
    if (one === undefined) return;
    this.client.cancel(one.call, this.now);
    this.begun.delete(one.call);
    this.flush();
  }

  private disturb(script: Script): void {
    const which = script.below(6);
    if (which === 0) this.server.closeAll(this.now);
    if (which === 1) this.server.endConnection(peer);
    if (which === 2) this.sealedServer?.review(this.now);
    if (which === 3) this.wait(script.byte() * 300 * millisecond);
    if (which === 4 && !this.client.isReady) {
      this.client.open(0, this.now + 5000 * millisecond, this.now);
    }
    this.flush();
  }

  private wait(time: number): void {
    const end = this.now + time;
    for (let i = 0; i < 30; i += 1) {
      const next = Math.min(this.client.nextTime(), this.server.nextTime(this.now));
      this.now = Math.min(Math.max(next, this.now), end);
      this.client.onTime(this.now);
      this.server.onTime(this.now);
      this.sealedServer?.onTime(this.now);
      this.flush();
      if (this.now >= end) return;
    }
    this.now = end;
  }

  // Each call has a deadline, but for those that were begun as streams.
  private end(): void {
    for (let i = 0; i < 4; i += 1) this.wait(10_000 * millisecond);
    for (const one of this.begun.values()) {
      assert.ok(one.isStream || one.hasEnded || !one.call.isOpen, "a call outlives its deadline");
    }
  }

  private feedServer(frame: Uint8Array): void {
    const before = this.toClient.length;
    if (this.sealedServer === undefined) this.server.onFrame(frame, peer, this.now);
    else this.sealedServer.onFrame(frame, peer, this.now);
    this.flush();
    for (const answer of this.toClient.slice(before)) {
      const header = readFrame(answer, this.medium);
      const isUnproven =
        typeof header !== "string" &&
        (header.kind === FrameKind.COOKIE || header.kind === FrameKind.REFUSE);
      assert.ok(!isUnproven || answer.length <= Math.max(frame.length, headerSize), "amplified");
    }
  }

  private feedClient(frame: Uint8Array): void {
    if (this.sealedClient === undefined) this.client.onFrame(frame, this.now);
    else this.sealedClient.receive(frame, this.now);
    this.flush();
  }

  private flush(): void {
    this.flushClient();
    for (const { frame } of this.sealedServer?.takeFrames() ?? []) this.emit(this.toClient, frame);
    for (const { frame } of this.server.takeFrames()) {
      assert.notEqual(typeof readFrame(frame, this.medium), "string", "it sends frames");
      const sent = this.sealedServer === undefined ? frame : this.sealedServer.seal(frame);
      if (sent !== undefined) this.emit(this.toClient, sent);
    }
    for (const event of this.server.takeEvents()) {
      if (event.kind !== "run") continue;
      const { session, callId } = event.request.header;
      const id = `${session} ${callId}`;
      assert.ok(!this.ran.has(id), "a call runs twice");
      this.ran.add(id);
      if (event.request.wantsReceipt) this.server.accept(event.request, Status.ok, this.now);
      this.running.push(event.request);
    }
    for (const { frame } of this.server.takeFrames()) {
      const sent = this.sealedServer === undefined ? frame : this.sealedServer.seal(frame);
      if (sent !== undefined) this.emit(this.toClient, sent);
    }
  }

  private flushClient(): void {
    for (let i = 0; i < 20; i += 1) {
      const frames = this.client.takeFrames();
      if (this.sealedClient === undefined) {
        for (const frame of frames) this.emit(this.toServer, frame);
        break;
      }
      for (const frame of frames) this.sealedClient.send(frame);
      for (const frame of this.sealedClient.takeFrames()) this.emit(this.toServer, frame);
      const delivered = this.sealedClient.takeDelivered();
      for (const frame of delivered) this.client.onFrame(frame, this.now);
      if (frames.length === 0 && delivered.length === 0) break;
    }
    for (const event of this.client.takeEvents()) {
      if (event.kind === "reply") this.takeReply(event.call, event.status, event.payload);
      if (event.kind === "timeout" && event.call !== undefined) this.endCall(event.call);
      if ("calls" in event) for (const call of event.calls) this.endCall(call);
    }
  }

  private takeReply(call: OpenCall, status: number, payload: Uint8Array): void {
    const one = this.endCall(call);
    if (one === undefined) return;
    this.replyCount += 1;
    const isReceipt = payload.length === 0;
    if (status === Status.ok && !one.isStream && !isReceipt) this.expectWhole(payload, one, 1);
  }

  private expectWhole(payload: Uint8Array, { request }: Begun, number: number): void {
    if (this.isCorrupt && !this.isSealed) return;
    const expected = number.toString(16).padStart(2, "0") + request;
    assert.ok(toHex(payload) === expected, "what comes is what was sent");
  }

  private endCall(call: OpenCall): Begun | undefined {
    const one = this.begun.get(call);
    if (one === undefined) return undefined;
    assert.ok(!one.hasEnded, "a call ends twice");
    one.hasEnded = true;
    if (!one.isStream) this.begun.delete(call);
    return one;
  }

  private emit(frames: Uint8Array[], frame: Uint8Array): void {
    this.sentCount += 1;
    assert.ok(this.sentCount < 200_000, "the sides send without end");
    if (frames.length < inFlightMax) frames.push(frame);
    const sent = frames === this.toServer ? this.sentUp : this.sentDown;
    sent.push(frame.slice());
    if (sent.length > 256) sent.shift();
  }
}

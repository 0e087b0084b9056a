import assert from "node:assert/strict";
import { test } from "node:test";
import { fromHex, toHex } from "../src/core/bytes.js";
import {
  ClientChannel,
  type CallParameters,
  type ChannelEvent,
} from "../src/core/client_channel.js";
import { frameOf, newHeader } from "../src/core/header.js";
import { FrameKind, Status, millisecond, second, type Medium } from "../src/core/numbers.js";
import { ServerSessions, type ServerEvent } from "../src/core/server_sessions.js";
import { nodeAlgorithms } from "../src/node/algorithms.js";
import { Suite, newKeyPair, type Algorithms } from "../src/sealed/algorithms.js";
import { SealedClient, keyFingerprint, keyText, parseKey } from "../src/sealed/client.js";
import { sealedPayloadMax } from "../src/sealed/frames.js";
import { SealedServer } from "../src/sealed/server.js";
import { DropWatch } from "./support/vectors.js";

// A client and a server with sealed sessions, and an attacker on the way (spec/security.md).

const peer = { key: "a:1", host: "a" };
const clientKeys = newKeyPair(nodeAlgorithms);
const serverKeys = newKeyPair(nodeAlgorithms);
const parameters: CallParameters = {
  service: 1,
  method: 2,
  priority: 24000,
  deadline: 100 * second,
};

class World {
  now = second;
  admitted = true;
  channel: ClientChannel;
  client: SealedClient;
  sessions!: ServerSessions;
  server!: SealedServer;
  readonly seen: ChannelEvent[] = [];
  readonly run: ServerEvent[] = [];
  /** The attacker replaces a frame by none, itself, or others. */
  toServer = (frame: Uint8Array): Uint8Array[] => [frame];
  toClient = (frame: Uint8Array): Uint8Array[] => [frame];

  constructor(
    readonly medium: Medium = "datagram",
    readonly algorithms: Algorithms = nodeAlgorithms,
    serverKey = serverKeys.publicKey,
  ) {
    const framePayloadMax = sealedPayloadMax(medium);
    const messageSizeMax = 100_000;
    this.channel = new ClientChannel({
      medium,
      clientEpoch: 1n,
      channel: 1n,
      framePayloadMax,
      messageSizeMax,
    });
    this.client = new SealedClient({ algorithms, medium, own: clientKeys, serverKey });
    this.startServer(7n);
  }
  startServer(epoch: bigint): void {
    const { medium, algorithms } = this;
    const framePayloadMax = sealedPayloadMax(medium);
    const { random } = algorithms;
    const messageSizeMax = 100_000;
    this.sessions = new ServerSessions({ medium, epoch, random, framePayloadMax, messageSizeMax });
    const admits = (key: Uint8Array): boolean =>
      this.admitted && toHex(key) === toHex(clientKeys.publicKey);
    this.server = new SealedServer({ algorithms, medium, own: serverKeys, admits }, this.sessions);
  }

  open(): void {
    this.channel.open(24000, this.now + second, this.now);
    this.pump();
  }
  /** Moves frames until no more are on their way. */
  pump(): void {
    for (let isMoving = true; isMoving;) {
      isMoving = false;
      for (const frame of this.channel.takeFrames()) this.client.send(frame);
      for (const frame of this.client.takeDelivered()) {
        this.channel.onFrame(frame, this.now);
        isMoving = true;
      }
      for (const frame of this.client.takeFrames()) {
        isMoving = true;
        for (const sent of this.toServer(frame)) this.server.onFrame(sent, peer, this.now);
      }
      this.seen.push(...this.channel.takeEvents());
      for (const event of this.sessions.takeEvents()) {
        this.run.push(event);
        if (event.kind !== "run") continue;
        this.sessions.complete(event.request, Status.ok, event.request.payload, this.now);
      }
      const sealed = this.sessions.takeFrames().map(({ frame }) => this.server.seal(frame));
      const sent = [...this.server.takeFrames().map(({ frame }) => frame), ...sealed];
      for (const frame of sent) {
        if (frame === undefined) continue;
        isMoving = true;
        for (const one of this.toClient(frame)) this.client.receive(one, this.now);
      }
    }
  }
  call(payload = fromHex("0102")): void {
    assert.equal(typeof this.channel.call(parameters, payload, this.now), "object");
    this.pump();
  }
  /** Lets time pass, with timers of both sides. */
  wait(ns: number): void {
    const end = this.now + ns;
    while (this.now < end) {
      this.now = Math.min(end, this.now + millisecond);
      this.channel.onTime(this.now);
      this.server.onTime(this.now);
      this.pump();
    }
  }
  kinds(): string[] {
    return this.seen.map((event) => event.kind);
  }
}

function passNoting(list: Uint8Array[]): (frame: Uint8Array) => Uint8Array[] {
  return (frame) => {
    list.push(frame);
    return [frame];
  };
}

for (const medium of ["datagram", "stream"] as const) {
  for (const [name, suites] of Object.entries(Suite)) {
    test(`calls over a ${medium}, suite ${name}`, () => {
      const world = new World(medium, { ...nodeAlgorithms, suites });
      const watched: Uint8Array[] = [];
      world.toServer = passNoting(watched);
      world.open();
      world.call();
      const secret = new Uint8Array(50_000).fill(0x5a);
      world.call(secret);
      assert.deepEqual(world.kinds(), ["ready", "reply", "reply"]);
      const last = world.seen[2];
      assert.ok(last?.kind === "reply" && toHex(last.payload) === toHex(secret));
      const text = "5a".repeat(16);
      assert.ok(!watched.some((frame) => toHex(frame).includes(text)), "a payload is readable");
    });
  }
}

test("a key that is not admitted opens no session", () => {
  const world = new World();
  world.admitted = false;
  world.open();
  assert.deepEqual(world.kinds(), []);
  assert.equal(world.client.hint, Status.not_allowed);
  world.wait(1.5 * second);
  assert.deepEqual(world.kinds(), ["timeout"]);
  assert.equal(world.sessions.sessionCount, 0);
});

test("a client does not speak with another key than its server's", () => {
  const other = newKeyPair(nodeAlgorithms).publicKey;
  const world = new World("datagram", nodeAlgorithms, other);
  const drops = new DropWatch(world.server.counters);
  world.open();
  assert.deepEqual(world.kinds(), []);
  assert.deepEqual(drops.since(), ["bad_seal"]);
  assert.equal(toHex(world.client.otherKey!), toHex(serverKeys.publicKey));
});

test("an unsealed client gets nothing", () => {
  const world = new World();
  const plain = new ClientChannel({ medium: "datagram", clientEpoch: 2n, channel: 1n });
  plain.open(24000, 2 * second, world.now);
  const drops = new DropWatch(world.server.counters);
  for (const frame of plain.takeFrames()) world.server.onFrame(frame, peer, world.now);
  assert.deepEqual(drops.since(), ["unsealed"]);
  assert.deepEqual(world.sessions.takeFrames(), []);
});

test("frames that are repeated, changed or stripped run nothing", () => {
  const world = new World();
  world.open();
  let sealed = new Uint8Array(0);
  world.toServer = (frame) => [(sealed = frame.slice())];
  world.call();
  assert.equal(world.run.length, 1);
  const drops = new DropWatch(world.server.counters);
  const changed = sealed.slice();
  changed[64]! ^= 1;
  changed[66]! ^= 1; // the counter
  const stripped = sealed.slice();
  stripped[6]! &= ~16;
  for (const frame of [sealed, changed, stripped]) world.server.onFrame(frame, peer, world.now);
  assert.deepEqual(drops.since().sort(), ["bad_seal", "replayed"]);
  assert.deepEqual(world.sessions.takeEvents(), []);
});

test("a forged REFUSE ends nothing, and is looked into", () => {
  const world = new World();
  world.open();
  world.toServer = () => []; // the attacker holds the call
  world.call();
  const forged = newHeader(FrameKind.REFUSE, 24000, 0);
  forged.session = world.channel.session;
  forged.callId = 1;
  forged.status = Status.unknown_session;
  world.client.receive(frameOf(forged), world.now);
  world.toServer = (frame) => [frame];
  world.wait(10 * millisecond);
  assert.deepEqual(world.kinds(), ["ready", "reply"]);
  assert.equal(world.sessions.sessionCount, 1);
});

test("a server that restarted is asked, and its session is lost", () => {
  const world = new World();
  world.open();
  world.startServer(8n);
  world.call();
  assert.deepEqual(world.kinds(), ["ready", "lost"]);
  world.open();
  world.call();
  assert.deepEqual(world.kinds(), ["ready", "lost", "ready", "reply"]);
  assert.equal(world.channel.welcome?.serverEpoch, 8n);
});

test("a key that is no longer admitted loses its session", () => {
  const world = new World();
  world.open();
  world.call();
  world.admitted = false;
  world.server.review(world.now);
  world.pump();
  assert.deepEqual(world.kinds(), ["ready", "reply", "closed"]);
  assert.equal(world.sessions.sessionCount, 0);
});

test("a call that was held back for longer than its budget does not run", () => {
  const world = new World();
  world.open();
  world.call();
  const held: Uint8Array[] = [];
  world.toServer = (frame) => {
    held.push(frame);
    return [];
  };
  const brief = { ...parameters, deadline: world.now + 50 * millisecond };
  world.channel.call(brief, fromHex("03"), world.now);
  world.pump();
  world.now += 60 * millisecond;
  for (const frame of held) world.server.onFrame(frame, peer, world.now);
  assert.equal(world.sessions.takeEvents().length, 0);
  assert.ok(world.server.counters.expiredCount > 0);
});

test("a half-open session answers copies of its HELLO, and ends", () => {
  const world = new World();
  world.toClient = (frame) => (frame[3] === FrameKind.WELCOME ? [] : [frame]);
  const hellos: Uint8Array[] = [];
  world.toServer = passNoting(hellos);
  world.open();
  // The WELCOME is lost: the client repeats the same bytes, and gets the same session.
  world.toClient = (frame) => [frame];
  world.wait(20 * millisecond);
  assert.equal(world.sessions.sessionCount, 1);
  assert.equal(world.server.halfOpenCount, 1);
  assert.equal(toHex(hellos.at(-1)!), toHex(hellos.at(-2)!));
  world.wait(2.1 * second);
  assert.equal(world.sessions.sessionCount, 0);
});

test("texts of keys", () => {
  assert.deepEqual(parseKey(keyText(serverKeys.publicKey)), Uint8Array.from(serverKeys.publicKey));
  assert.equal(parseKey("rtpm25519 AAAA"), undefined);
  const ones = new Uint8Array(32).fill(1);
  assert.equal(keyFingerprint(nodeAlgorithms, ones), "72cd-6e84-22c4-07fb-6d09");
});

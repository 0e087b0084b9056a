import assert from "node:assert/strict";
import { test } from "node:test";
import { fromHex, toHex } from "../src/core/bytes.js";
import { ClientChannel } from "../src/core/client_channel.js";
import { clockDomainOf } from "../src/core/clock_domain.js";
import * as control from "../src/core/control.js";
import { readDiscovery, writeDiscovery } from "../src/core/discovery.js";
import { readHello, writeHello, writeWelcome } from "../src/core/handshake.js";
import { frameOf, newHeader, readHeader, type Header } from "../src/core/header.js";
import { findObstacle } from "../src/core/interface_text.js";
import { FrameKind, Status, never, type StatusName } from "../src/core/numbers.js";
import { ServerSessions } from "../src/core/server_sessions.js";
import { parseUrl, urlText } from "../src/core/url.js";
import { DropWatch, fixedRandom, readVectors, type Json } from "./support/vectors.js";

// The payloads of spec/vectors.

const priority = 24000;

function forEach(
  name: string,
  list: string,
  run: (vector: Json, payload: Uint8Array) => void,
): void {
  for (const vector of readVectors(name)[list] as Json[]) {
    test(`${name}, ${list}: ${vector.name}`, () => run(vector, fromHex(vector.hex)));
  }
}

function headerOf(frame: Uint8Array | undefined): Header {
  const header = readHeader(frame ?? new Uint8Array(0));
  assert.ok(typeof header !== "string", "no frame was sent");
  return header;
}

// ---- handshake ----------------------------------------------------------------------------------

function askServer(payload: Uint8Array): { drops: string[]; answers: Uint8Array[] } {
  const random = fixedRandom();
  const server = new ServerSessions({ medium: "datagram", epoch: 1n, random });
  const drops = new DropWatch(server.counters);
  const frame = frameOf(newHeader(FrameKind.HELLO, priority, payload.length), payload);
  server.onFrame(frame, { key: "a:1", host: "a" }, 1e9);
  return { drops: drops.since(), answers: server.takeFrames().map((one) => one.frame) };
}

forEach("hello.json", "good", (vector, payload) => {
  const hello = readHello(payload);
  assert.ok(hello !== undefined);
  assert.deepEqual(
    {
      version_min: hello.versionMin,
      version_max: hello.versionMax,
      features: hello.features,
      message_size_max: hello.messageSizeMax,
      cookie: toHex(hello.cookie),
    },
    {
      version_min: vector.fields.version_min,
      version_max: vector.fields.version_max,
      features: vector.fields.features,
      message_size_max: vector.fields.message_size_max,
      cookie: vector.fields.cookie,
    },
  );
  assert.equal(hello.clientEpoch, BigInt(vector.fields.client_epoch));
  assert.equal(hello.channel, BigInt(vector.fields.channel));
  assert.equal(hello.clockDomain, BigInt(vector.fields.clock_domain));
  assert.equal(toHex(writeHello(hello)), vector.hex);
  const answer = headerOf(askServer(payload).answers[0]);
  assert.equal(answer.kind, FrameKind[vector.answer.kind as keyof typeof FrameKind]);
  const status = (vector.answer.status ?? "ok") as StatusName;
  assert.equal(answer.status, Status[status]);
});
forEach("hello.json", "bad", (vector, payload) => {
  assert.deepEqual(askServer(payload), { drops: [vector.drop], answers: [] });
});

class OpeningClient {
  readonly channel = new ClientChannel({ medium: "datagram", clientEpoch: 1n, channel: 1n });
  readonly drops = new DropWatch(this.channel.counters);
  private readonly number: number;

  constructor() {
    this.channel.open(priority, never, 1);
    this.number = headerOf(this.channel.takeFrames()[0]).callId;
  }
  receive(kind: 2 | 3, session: bigint, payload: Uint8Array): void {
    const header = newHeader(kind, priority, payload.length);
    header.session = session;
    header.callId = this.number;
    this.channel.onFrame(frameOf(header, payload), 2);
  }
}

forEach("cookie.json", "good", (vector, payload) => {
  const client = new OpeningClient();
  client.receive(FrameKind.COOKIE, 0n, payload);
  const hello = readHello((client.channel.takeFrames()[0] ?? new Uint8Array(0)).subarray(64));
  assert.equal(toHex(hello?.cookie ?? new Uint8Array(0)), vector.hex);
});
forEach("cookie.json", "bad", (vector, payload) => {
  const client = new OpeningClient();
  client.receive(FrameKind.COOKIE, 0n, payload);
  assert.deepEqual(client.drops.since(), [vector.drop]);
  assert.equal(client.channel.takeFrames().length, 0);
});

forEach("welcome.json", "good", (vector, payload) => {
  const client = new OpeningClient();
  client.receive(FrameKind.WELCOME, BigInt(vector.session), payload);
  assert.deepEqual(client.channel.takeEvents(), [{ kind: "ready" }]);
  assert.equal(client.channel.session, BigInt(vector.session));
  const { fields } = vector;
  const welcome = client.channel.welcome;
  assert.deepEqual(welcome, {
    band: { low: fields.band_low, high: fields.band_high },
    ceiling: fields.ceiling,
    features: fields.features,
    window: fields.window,
    serverEpoch: BigInt(fields.server_epoch),
    clockDomain: BigInt(fields.clock_domain),
    messageSizeMax: fields.message_size_max,
  });
  assert.equal(toHex(writeWelcome(welcome!)), vector.hex);
});
forEach("welcome.json", "bad", (vector, payload) => {
  const client = new OpeningClient();
  client.receive(FrameKind.WELCOME, BigInt(vector.session), payload);
  assert.deepEqual(client.drops.since(), [vector.drop]);
  assert.equal(client.channel.isReady, false);
});

// ---- ACK, CREDIT, bind --------------------------------------------------------------------------

forEach("ack.json", "good", (vector, payload) => {
  const ack = control.readAck(payload);
  assert.ok(ack !== undefined);
  assert.equal(ack.firstMissing, vector.fields.first_missing);
  assert.equal(toHex(ack.later), vector.fields.later);
  assert.equal(toHex(control.writeAck(ack)), vector.hex);
});
forEach("ack.json", "bad", (vector, payload) => {
  assert.equal(control.readAck(payload), undefined);
  assert.equal(vector.drop, "bad_payload");
});

forEach("credit.json", "good", (vector, payload) => {
  const credit = control.readCredit(payload);
  assert.ok(credit !== undefined);
  assert.equal(credit.firstMissing, vector.fields.first_missing);
  assert.equal(credit.byteLimit, vector.fields.byte_limit);
  assert.equal(credit.later, BigInt(vector.fields.later));
  assert.equal(toHex(control.writeCredit(credit)), vector.hex);
});
forEach("credit.json", "bad", (vector, payload) => {
  assert.equal(control.readCredit(payload), undefined);
  assert.equal(vector.drop, "bad_payload");
});

forEach("bind-request.json", "good", (vector, payload) => {
  const request = control.readBindRequest(payload);
  assert.deepEqual(request, {
    fingerprint: BigInt(vector.fingerprint),
    path: vector.path,
    interfaceName: vector.interface,
  });
  assert.equal(toHex(control.writeBindRequest(request!)), vector.hex);
});
forEach("bind-request.json", "bad", (vector, payload) => {
  assert.equal(control.readBindRequest(payload), undefined);
  assert.equal(vector.status, "bad_request");
});

forEach("bind-reply.json", "good", (vector, payload) => {
  const reply = control.readBindReply(payload);
  assert.deepEqual(reply, {
    service: vector.service,
    priority: vector.priority,
    isServerDeclared: vector.is_server_declared,
    isMethodListComplete: vector.is_method_list_complete,
    fingerprint: BigInt(vector.fingerprint),
    methods: vector.methods,
  });
  assert.equal(toHex(control.writeBindReply(reply!)), vector.hex);
});
forEach("bind-reply.json", "bad", (vector, payload) => {
  assert.equal(control.readBindReply(payload), undefined);
  assert.equal(vector.is_taken, false);
});

// ---- addresses, discovery, clocks, versions -----------------------------------------------------

test("addresses", () => {
  const { good, bad } = readVectors("urls.json");
  for (const { text, ...url } of good) {
    assert.deepEqual(parseUrl(text), url);
    assert.equal(urlText(url), text);
  }
  for (const text of bad) assert.equal(parseUrl(text), undefined, text);
});

forEach("discovery.json", "good", (vector, payload) => {
  const message = readDiscovery(payload);
  assert.deepEqual(message, {
    kind: vector.kind,
    domain: vector.domain,
    number: BigInt(vector.number),
    services: vector.services.map((service: Json) => ({
      port: service.port,
      isRegistry: service.is_registry,
      processId: service.process_id,
    })),
  });
  assert.equal(toHex(writeDiscovery(message!)), vector.hex);
});
forEach("discovery.json", "bad", (_, payload) => {
  assert.equal(readDiscovery(payload), undefined);
});

test("clock domains", () => {
  for (const vector of readVectors("clock-domain.json").vectors) {
    const domain = clockDomainOf(vector.boot_id, vector.time_namespace);
    assert.equal(domain, BigInt(vector.clock_domain), vector.name);
  }
});

for (const pair of readVectors("versions.json").pairs as Json[]) {
  test(`versions of an interface: ${pair.name}`, () => {
    const obstacle = findObstacle(pair.client, pair.server);
    assert.equal(obstacle === undefined, pair.is_understood, obstacle);
  });
}

import assert from "node:assert/strict";
import { test } from "node:test";
import { fromHex, toHex, viewOf } from "../src/core/bytes.js";
import { headerSize, type DropReason } from "../src/core/numbers.js";
import { readFrame, readHeader } from "../src/core/header.js";
import { nodeAlgorithms } from "../src/node/algorithms.js";
import { Suite, keyPairOf } from "../src/sealed/algorithms.js";
import * as frames from "../src/sealed/frames.js";
import { Initiator, Responder, type HandshakeConfig } from "../src/sealed/noise.js";
import { SealedSession, nextKey } from "../src/sealed/session.js";
import { readVectors, type Json } from "./support/vectors.js";

// spec/vectors/sealed.json.

const vectors = readVectors("sealed.json");
const suites: Record<string, Suite> = {
  Noise_IKpsk2_25519_ChaChaPoly_SHA256: Suite.chaChaPoly,
  Noise_IKpsk2_25519_AESGCM_SHA256: Suite.aesGcm,
};

test("the COOKIE", () => {
  const payload = fromHex(vectors.cookie.hex);
  const cookie = frames.readSealedCookie(payload);
  assert.ok(cookie !== undefined);
  assert.equal(toHex(cookie.cookie), vectors.cookie.cookie);
  assert.equal(toHex(cookie.serverKey), vectors.cookie.server_key);
  assert.equal(cookie.suites, vectors.cookie.suites);
  assert.deepEqual(frames.writeSealedCookie(cookie), payload);
});

for (const vector of vectors.bad_payloads as Json[]) {
  test(`a bad ${vector.kind}: ${vector.name}`, () => {
    const payload = fromHex(vector.hex);
    if (vector.kind === "COOKIE") assert.equal(frames.readSealedCookie(payload), undefined);
    if (vector.kind === "HELLO") assert.equal(frames.readSealedHello(payload), undefined);
    if (vector.kind === "WELCOME") {
      assert.equal(frames.readSealedWelcome(payload, frames.Feature.sealed), undefined);
    }
  });
}

function configOf(vector: Json, side: "client" | "server"): HandshakeConfig {
  const hello = fromHex(vector.hello);
  const header = readHeader(hello);
  assert.ok(typeof header !== "string");
  const prologue = frames.prologueOf(
    header.priority,
    header.callId,
    hello.subarray(headerSize, headerSize + 64),
    vector.cookie === "" ? undefined : fromHex(vector.cookie),
  );
  assert.equal(toHex(prologue), vector.prologue);
  return {
    algorithms: nodeAlgorithms,
    suite: suites[vector.suite]!,
    own: keyPairOf(nodeAlgorithms, fromHex(vector[`${side}_private`])),
    ephemeral: keyPairOf(nodeAlgorithms, fromHex(vector[`${side}_ephemeral`])),
    preshared: fromHex(vector.psk),
    prologue,
  };
}

for (const vector of vectors.handshakes as Json[]) {
  const message1 = fromHex(vector.hello).subarray(headerSize + 64);
  const message2 = fromHex(vector.welcome).subarray(headerSize);
  const former = new Uint8Array(8);
  viewOf(former).setBigUint64(0, BigInt(vector.former_session), true);

  test(`a client's handshake: ${vector.name}`, () => {
    const server = keyPairOf(nodeAlgorithms, fromHex(vector.server_private));
    const initiator = new Initiator(configOf(vector, "client"), server.publicKey);
    assert.equal(toHex(initiator.writeMessage1(former)!), toHex(message1));
    const forged = message2.slice();
    forged[40]! ^= 1;
    assert.equal(initiator.readMessage2(forged), undefined); // sec-3-4: it goes on waiting
    const read = initiator.readMessage2(message2);
    assert.ok(read !== undefined);
    assert.equal(toHex(read.payload), vector.welcome_inside);
    assert.equal(toHex(read.keys.client), vector.client_key);
    assert.equal(toHex(read.keys.server), vector.server_key);
    assert.equal(toHex(read.keys.handshakeHash), vector.handshake_hash);
    const features = viewOf(fromHex(vector.hello)).getUint32(headerSize + 4, true);
    assert.equal(frames.readSealedWelcome(read.payload, features)?.former, vector.former);
  });

  test(`a server's handshake: ${vector.name}`, () => {
    const responder = new Responder(configOf(vector, "server"));
    const hello = frames.readSealedHello(fromHex(vector.hello).subarray(headerSize));
    assert.ok(hello !== undefined);
    assert.equal(frames.suiteOf(hello.hello.features), suites[vector.suite]);
    const read = responder.readMessage1(hello.message);
    const client = keyPairOf(nodeAlgorithms, fromHex(vector.client_private));
    assert.equal(toHex(read!.clientKey), toHex(client.publicKey));
    assert.equal(toHex(read!.payload), toHex(former));
    const inside = fromHex(vector.welcome_inside);
    const welcome = frames.readSealedWelcome(inside, hello.hello.features);
    assert.equal(toHex(frames.writeSealedWelcome(welcome!)), vector.welcome_inside);
    const written = responder.writeMessage2(inside);
    assert.equal(toHex(written!.message), toHex(message2));
    assert.equal(toHex(written!.keys.client), vector.client_key);
    assert.equal(toHex(written!.keys.server), vector.server_key);
  });
}

function sessionOf(vector: Json, isExact: boolean): SealedSession {
  const key = fromHex(vector.key);
  const suite = suites[vector.suite]!;
  return new SealedSession(nodeAlgorithms, suite, { send: key, receive: key }, isExact);
}

test("frames are sealed and opened, one after the other", () => {
  let sender: SealedSession | undefined;
  let receiver: SealedSession | undefined;
  for (const vector of vectors.frames as Json[]) {
    if (vector.counter === 0) {
      sender = sessionOf(vector, false);
      receiver = sessionOf(vector, true);
    }
    const header = fromHex(vector.header);
    const sealed = sender?.seal(frames.sealedHeader(header), fromHex(vector.payload));
    assert.equal(toHex(sealed!), vector.hex, vector.name);
    assert.ok(typeof frames.readSealedFrame(sealed!, "datagram") !== "string");
    // A receiver without level S drops it (hp-2-2).
    assert.equal(readFrame(sealed!, "datagram"), "reserved_set");
    const payload = receiver?.open(sealed!);
    assert.ok(payload instanceof Uint8Array, vector.name);
    assert.equal(toHex(payload), vector.payload);
  }
});

/** The reason for which a frame is dropped; "" if it is taken. */
function openedAs(session: SealedSession, frame: Uint8Array): DropReason | "" {
  const header = frames.readSealedFrame(frame, "datagram");
  if (typeof header === "string") return header;
  const opened = session.open(frame);
  return typeof opened === "string" ? opened : "";
}

test("bad frames are dropped, and change nothing", () => {
  const [good, ...bad] = vectors.bad_frames as Json[];
  const session = sessionOf(good, false);
  for (const vector of bad) {
    assert.equal(openedAs(session, fromHex(vector.hex)), vector.drop, vector.name);
  }
  assert.equal(openedAs(session, fromHex(good.hex)), "");
});

test("each key follows from the one before", () => {
  for (const vector of vectors.keys as Json[]) {
    for (let i = 1; i < vector.keys.length; i += 1) {
      const next = nextKey(nodeAlgorithms, suites[vector.suite]!, fromHex(vector.keys[i - 1]));
      assert.equal(toHex(next), vector.keys[i]);
    }
  }
});

for (const vector of vectors.windows as Json[]) {
  test(`a window: ${vector.name}`, () => {
    const session = sessionOf(vector, false);
    for (const step of vector.steps as Json[]) {
      assert.equal(openedAs(session, fromHex(step.hex)), step.drop ?? "", step.counter);
    }
  });
}

test("on a stream the flag is reserved where the receiver has no level S", () => {
  const sealed = fromHex(vectors.frames[0].hex);
  assert.equal(frames.frameSizeOf(sealed.subarray(0, headerSize), "stream", true), sealed.length);
  const size = frames.frameSizeOf(sealed.subarray(0, headerSize), "stream", false);
  assert.equal(size, "reserved_set");
});

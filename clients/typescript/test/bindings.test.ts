import assert from "node:assert/strict";
import { test } from "node:test";
import { Binding } from "../src/client/binding.js";
import { CallError } from "../src/client/errors.js";
import { ServerLink } from "../src/client/server_link.js";
import type { TransportListener } from "../src/client/transport.js";
import { fromHex, toHex, viewOf } from "../src/core/bytes.js";
import { headerSize } from "../src/core/numbers.js";
import type { Codec } from "../src/values/codec.js";
import type { AnyMethod } from "../src/values/method.js";
import { FreeBytes } from "./support/free_bytes.js";
import { conversationNames, readVectors, type Json } from "./support/vectors.js";
import { VirtualClock, VirtualRoute, settle } from "./support/virtual.js";

// The conversations of spec/vectors for clients that look after sessions by themselves.

const bytes: Codec<Uint8Array> = { encode: (value) => value, decode: (value) => value.slice() };

class Client {
  readonly clock = new VirtualClock();
  readonly route: VirtualRoute;
  seen: Json[] = [];
  private readonly link: ServerLink;
  private binding: Binding | undefined;
  private methods: AnyMethod[] = [];

  constructor(conversation: Json) {
    const { client } = conversation.setup;
    this.route = new VirtualRoute(conversation.medium);
    this.link = new ServerLink(conversation.medium, (number) => ({
      route: this.route,
      clock: this.clock,
      channel: {
        clientEpoch: BigInt(client.epoch),
        channel: BigInt(client.channel) + BigInt(number),
        clockDomain: BigInt(client.clock_domain),
        messageSizeMax: client.message_size_max,
      },
    }));
  }

  act(step: Json): void {
    if (step.client_does === "bind") {
      const unnamed = { kind: "call", request: bytes, reply: bytes } as const;
      this.methods = step.methods.map((one: Json) => ({ ...unnamed, ...one, name: `m${one.id}` }));
      this.binding = new Binding({
        place: { link: this.link, path: step.path },
        clock: this.clock,
        description: {
          name: step.interface,
          fingerprint: BigInt(step.fingerprint),
          methods: this.methods,
        },
        priority: step.priority,
        deadlineMs: 1000,
        streamWindow: 8,
      });
      this.note(
        this.binding.open().then(() => ({ client_sees: "bound" })),
        "not_bound",
      );
      return;
    }
    assert.equal(step.client_does, "call_object");
    const method = { ...this.methods.find((one) => one.id === step.method)! };
    const { priority } = step;
    const options = { priority, traceId: BigInt(step.trace_id) };
    const idempotent = { ...method, isIdempotent: step.is_idempotent };
    this.note(
      this.binding!.invoke(idempotent, fromHex(step.payload), options).then((payload) => ({
        client_sees: "result",
        status: "ok",
        payload: toHex(payload),
      })),
      "may_have_run",
    );
  }

  private note(promise: Promise<Json>, failed: string): void {
    void promise.then(
      (step) => this.seen.push(step),
      (error: unknown) => {
        assert.ok(error instanceof CallError, String(error));
        if (failed === "may_have_run") assert.equal(error.wasRun, undefined);
        this.seen.push({ client_sees: failed });
      },
    );
  }
}

/** The HELLO as the vector has it: each session's channel is the client's to choose. */
function withChannelOne(frame: Uint8Array): Uint8Array {
  if (frame[3] !== 1) return frame;
  const copy = frame.slice();
  viewOf(copy).setBigUint64(headerSize + 16, 1n, true);
  return copy;
}

async function play(conversation: Json): Promise<void> {
  const free = new FreeBytes(conversation.free, "client");
  const client = new Client(conversation);
  let listener: TransportListener | undefined;
  for (const [index, step] of (conversation.steps as Json[]).entries()) {
    const where = `step ${index}: ${JSON.stringify(step)}`;
    client.clock.moveTo(step.at_ns);
    if (step.frame === "client to server") {
      const sent = client.route.sent.shift();
      assert.ok(sent !== undefined, `${where} was not sent`);
      const hex = toHex(withChannelOne(sent.frame));
      assert.ok(free.matches(step.hex, hex), `${where}\nsent: ${hex}`);
      listener = sent.listener;
    } else if (step.frame === "server to client") {
      listener?.onFrame(fromHex(free.fillIn(step.hex)));
      await settle();
    } else if (step.client_sees !== undefined) {
      const { at_ns: _, ...wanted } = step;
      assert.deepEqual(client.seen.shift(), wanted, where);
    } else {
      assert.deepEqual([client.route.sent, client.seen], [[], []], `surplus before ${where}`);
      client.act(step);
      await settle();
    }
  }
  assert.deepEqual([client.route.sent, client.seen], [[], []]);
}

for (const name of conversationNames()) {
  const conversation = readVectors(`conversations/${name}.json`);
  if (conversation.level !== "bindings") continue;
  test(name, () => play(conversation));
}

import assert from "node:assert/strict";
import { createSocket } from "node:dgram";
import { connect } from "node:net";
import { after, before, describe, test } from "node:test";
import { setTimeout as sleep } from "node:timers/promises";
import { toHex } from "../src/core/bytes.js";
import {
  CallError,
  Node,
  Refusal,
  Server,
  newKeyPair,
  nodeAlgorithms,
  operation,
  skeleton,
  type Binding,
  type Skeleton,
} from "../src/index.js";
import { Arm, add, blocks, count, echo, get, note, number, tell } from "./support/lab.js";

// Calls between a node and a server of this package, over real sockets.

class ArmServant {
  told: number[] = [];
  cancelled = 0;
  given = 0;
  priority = 0;
  runs = 0;

  skeleton(): Skeleton {
    return skeleton(Arm, [
      operation(echo, (value) => value),
      operation(add, (value, context) => this.add(value, context.signal)),
      operation(tell, (value) => void this.told.push(value)),
      operation(note, (value) => void this.told.push(value)),
      operation(count, (value) => this.count(value)),
      operation(get, (_, context) => this.get(context.priority)),
      operation(blocks, (size) => this.blocks(size)),
    ]);
  }
  private get(priority: number): number {
    this.priority = priority;
    this.runs += 1;
    return this.runs;
  }
  private async add(value: number, signal: AbortSignal): Promise<number> {
    if (value < 0) throw new Refusal("bad_request", "it must not be negative");
    if (value === 13) throw new Error("not for others");
    if (value < 1000) return value + 1;
    signal.addEventListener("abort", () => (this.cancelled += 1));
    await sleep(value, undefined, { signal, ref: false });
    return value;
  }
  private async *count(end: number): AsyncGenerator<number> {
    try {
      for (let i = 0; end < 0 || i < end; i += 1) {
        this.given += 1;
        yield i;
      }
    } finally {
      this.cancelled += 1;
    }
  }
  private async *blocks(size: number): AsyncGenerator<Uint8Array> {
    for (let i = 0; i < 5; i += 1) yield new Uint8Array(size).fill(i);
  }
}

async function fails(promise: Promise<unknown>, code: string): Promise<CallError> {
  try {
    await promise;
  } catch (error) {
    assert.ok(error instanceof CallError, String(error));
    assert.equal(error.code, code, error.message);
    return error;
  }
  return assert.fail(`it should have failed with ${code}`);
}

async function until(isTrue: () => boolean): Promise<void> {
  for (let i = 0; i < 500 && !isTrue(); i += 1) await sleep(4);
  assert.ok(isTrue());
}

const serverKeys = newKeyPair(nodeAlgorithms);
const ownKeys = newKeyPair(nodeAlgorithms);

for (const transport of ["udp", "tcp"] as const) {
  for (const isSealed of [false, true]) {
    describe(`over ${transport}${isSealed ? ", sealed" : ""}`, () => {
      const servant = new ArmServant();
      const errors: string[] = [];
      let server: Server;
      let node: Node;
      let arm: Binding;

      before(async () => {
        const admits = (key: Uint8Array): boolean => toHex(key) === toHex(ownKeys.publicKey);
        server = await Server.listen({
          onServantError: (error) => errors.push(String(error)),
          ...(isSealed ? { keys: { own: serverKeys, admits } } : {}),
        });
        server.add("lab/arm0", servant.skeleton());
        const keys = { own: ownKeys, serverKey: () => serverKeys.publicKey };
        node = new Node({ transport, ...(isSealed ? { keys } : {}) });
        arm = await node.bind(server.addressOf("lab/arm0"), Arm);
      });
      after(async () => {
        await node.close();
        await server.close();
      });

      test("calls of all sizes", async () => {
        for (const size of [0, 1, 1320, 1344, 1345, 70_000, 300_000]) {
          const value = new Uint8Array(size).map((_, i) => i * 7 + (i >> 9));
          const reply = await arm.call(echo, value, { deadlineMs: 10_000 });
          assert.ok(Buffer.from(reply).equals(value), `${size} bytes`);
        }
      });
      test("more calls at a time than the window has", async () => {
        const calls = Array.from({ length: 40 }, (_, i) => arm.call(add, i + 100));
        assert.deepEqual(
          await Promise.all(calls),
          calls.map((_, i) => i + 101),
        );
      });
      test("refusals and faults", async () => {
        const refused = await fails(arm.call(add, -1), "bad_request");
        assert.match(refused.message, /lab\/arm0\.add: .*it must not be negative/);
        assert.equal(refused.wasRun, false);
        const fault = await fails(arm.call(add, 13), "servant_failed");
        assert.equal(fault.wasRun, true);
        assert.ok(!fault.message.includes("not for others"));
        assert.match(errors.join(), /not for others/);
        await fails(arm.call({ ...add, id: 99 }, 1), "no_such_method");
        const short = { ...add, request: { encode: () => new Uint8Array(3), decode: () => 0 } };
        assert.match((await fails(arm.call(short, 1), "bad_request")).message, /8 bytes, not 3/);
      });
      test("deadlines and cancellation", async () => {
        const before = servant.cancelled;
        const late = await fails(arm.call(add, 5000, { deadlineMs: 30 }), "timeout");
        assert.equal(late.wasRun, undefined);
        const abort = new AbortController();
        const call = arm.call(add, 6000, { deadlineMs: 9000, signal: abort.signal });
        setTimeout(() => abort.abort(new Error("enough")), 20);
        await assert.rejects(call, /enough/);
        await until(() => servant.cancelled === before + 1);
      });
      test("oneways", async () => {
        servant.told = [];
        arm.send(tell, 1);
        await arm.call(note, 2);
        await until(() => servant.told.length === 2);
        assert.deepEqual(servant.told, [1, 2]);
        const large = {
          ...tell,
          request: { encode: () => new Uint8Array(70_000), decode: () => 0 },
        };
        assert.throws(() => arm.send(large, 1), /fit one frame/);
      });
      test("streams", async () => {
        const seen: number[] = [];
        for await (const item of arm.stream(count, 200)) seen.push(item);
        assert.deepEqual(
          seen,
          seen.map((_, i) => i),
        );
        assert.equal(seen.length, 200);
        for await (const _ of arm.stream(count, 0)) assert.fail();
        await assert.rejects(async () => {
          for await (const _ of arm.stream({ ...count, id: 98 }, 0)) assert.fail();
        }, /no_such_method/);
      });
      test("a stream that is left, and a slow reader", async () => {
        servant.given = 0;
        const before = servant.cancelled;
        for await (const item of arm.stream(count, -1)) {
          if (item === 3) await sleep(50);
          if (item === 5) break;
        }
        await until(() => servant.cancelled === before + 1);
        assert.ok(servant.given < 5 + 2 * 16 + 2, `${servant.given} items were given`);
      });
      test("large items", async () => {
        const sizes: number[] = [];
        for await (const block of arm.stream(blocks, 200_000)) {
          assert.ok(block.every((byte) => byte === sizes.length));
          sizes.push(block.length);
        }
        assert.deepEqual(sizes, new Array(5).fill(200_000));
      });
      test("the priority reaches the servant", async () => {
        await arm.call(get, undefined, { priority: 24000 });
        assert.equal(servant.priority, 24000);
        assert.throws(() => arm.send(tell, 0, { priority: 32768 }), RangeError);
      });
      test("other interfaces and paths", async () => {
        const address = server.addressOf("lab/arm1");
        const missing = await fails(node.bind(address, Arm), "no_such_object");
        assert.match(missing.message, /it has lab\/arm0/);
        const other = { ...Arm, name: "lab.Leg" };
        const wrong = node.bind(server.addressOf("lab/arm0"), other);
        assert.match((await fails(wrong, "interface_mismatch")).message, /lab\.Arm, not lab\.Leg/);
        const changed = { ...Arm, fingerprint: 1n, methods: [{ ...add, fingerprint: 77 }] };
        await fails(node.bind(server.addressOf("lab/arm0"), changed), "interface_mismatch");
        const subset = { ...Arm, fingerprint: 1n, methods: [add] };
        await node.bind(server.addressOf("lab/arm0"), subset);
      });
      test("a ping", async () => {
        assert.ok((await arm.ping()) < 1000);
      });
    });
  }
}

test("a server that restarts: the next call binds again", async () => {
  for (const transport of ["udp", "tcp"] as const) {
    const servant = new ArmServant();
    let server = await Server.listen();
    server.add("lab/arm0", servant.skeleton());
    await using node = new Node({ transport });
    const arm = await node.bind(server.addressOf("lab/arm0"), Arm);
    await arm.call(get, undefined);
    const { port } = server;
    await server.close();
    server = await Server.listen({ port });
    server.add("lab/other", servant.skeleton());
    server.add("lab/arm0", servant.skeleton());
    assert.equal(await arm.call(get, undefined), 2);
    await server.close();
  }
});

test("nobody there: an error that says so, in time", async () => {
  for (const transport of ["udp", "tcp"] as const) {
    await using node = new Node({ transport });
    const begun = Date.now();
    const promise = node.bind("rtpm://127.0.0.1:1/lab/arm0", Arm, { deadlineMs: 100 });
    assert.match((await fails(promise, "unreachable")).message, /127\.0\.0\.1:1 over/);
    assert.ok(Date.now() - begun < 1000);
  }
  await using node = new Node();
  await assert.rejects(node.bind("lab arm0", Arm), RangeError);
});

test("a client whose key is not admitted", async () => {
  const admits = (): boolean => false;
  await using server = await Server.listen({ keys: { own: serverKeys, admits } });
  for (const transport of ["udp", "tcp"] as const) {
    const keys = { own: ownKeys, serverKey: () => serverKeys.publicKey };
    await using node = new Node({ transport, keys });
    const promise = node.bind(server.addressOf("lab/arm0"), Arm, { deadlineMs: 200 });
    assert.match((await fails(promise, "not_allowed")).message, /admit/);
    await using plain = new Node({ transport });
    const unsealed = plain.bind(server.addressOf("lab/arm0"), Arm, { deadlineMs: 100 });
    await fails(unsealed, "unreachable");
  }
});

test("limits: running calls, connections of a host, garbage", async () => {
  const servant = new ArmServant();
  await using server = await Server.listen({ runningMax: 2, sessionCountMax: 4 });
  server.add("lab/arm0", servant.skeleton());
  await using node = new Node();
  const arm = await node.bind(server.addressOf("lab/arm0"), Arm);
  const abort = new AbortController();
  const { signal } = abort;
  const slow = [1, 2].map((i) => arm.call(add, 5000 + i, { deadlineMs: 9000, signal }));
  const slowEnd = Promise.allSettled(slow);
  await fails(arm.call(add, 1), "overload");
  abort.abort();
  await slowEnd;
  await until(() => servant.cancelled === 2);
  assert.equal(await arm.call(add, 1), 2);

  // 3 of 4 connections are one host's at most.
  const nodes = [1, 2, 3].map(() => new Node({ transport: "tcp" }));
  for (const one of nodes) await one.bind(server.addressOf("lab/arm0"), Arm);
  await using fourth = new Node({ transport: "tcp" });
  await fails(fourth.bind(server.addressOf("lab/arm0"), Arm), "overload");
  for (const one of nodes) await one.close();

  const garbage = connect(server.port, "127.0.0.1");
  garbage.write(Buffer.alloc(100, 0x41));
  await new Promise((resolve) => garbage.on("close", resolve));
  const socket = createSocket("udp4");
  socket.send(Buffer.alloc(70, 0x41), server.port, "127.0.0.1");
  await until(() => server.dropped.get("bad_magic") === 2);
  socket.close();
  assert.equal(await arm.call(add, 1), 2);
});

test("a reply that is no value of its type", async () => {
  const servant = new ArmServant();
  await using server = await Server.listen();
  server.add("lab/arm0", servant.skeleton());
  await using node = new Node();
  const arm = await node.bind(server.addressOf("lab/arm0"), Arm);
  const wrong = { ...echo, reply: number };
  const error = await fails(arm.call(wrong, new Uint8Array(3)), "bad_reply");
  assert.equal(error.wasRun, true);
});

test("a method's largest size, at both sides", async () => {
  const limited = { ...echo, maxSize: 100 };
  const server = await Server.listen();
  const Limited = { ...Arm, methods: [limited] };
  const repeat = (value: Uint8Array): Uint8Array => new Uint8Array(value.length * 2);
  server.add("limited", skeleton(Limited, [operation(limited, repeat)]));
  await using node = new Node();
  const object = await node.bind(server.addressOf("limited"), Limited);
  assert.equal((await object.call(limited, new Uint8Array(50))).length, 100);
  const own = await fails(object.call(limited, new Uint8Array(101)), "too_large");
  assert.deepEqual([own.wasRun, own.message.includes("101 bytes")], [false, true]);
  await fails(object.call(echo, new Uint8Array(101)), "too_large");
  await fails(object.call(echo, new Uint8Array(51)), "too_large");
  const narrow = { ...echo, maxSize: 99 };
  assert.equal((await fails(object.call(narrow, new Uint8Array(50)), "bad_reply")).wasRun, true);
  await server.close();
});

import assert from "node:assert/strict";
import { after, before, describe, test } from "node:test";
import { setTimeout as sleep } from "node:timers/promises";
import { DeviceClient, DeviceInterface } from "../idl/device.rtpm.js";
import {
  DescribeRequest,
  IntrospectionClient,
  IntrospectionInterface,
} from "../idl/introspection.rtpm.js";
import { NamesClient, NamesInterface, WatchPhase, WatchRequest } from "../idl/names.rtpm.js";
import { interopSkeleton, otherSkeleton } from "../idl/tests/interop.rtpm.js";
import { CallError, NameError, Node, Server, operation, skeleton } from "../src/index.js";
import { InteropServer } from "./interop/serve.js";
import { Arm, add, get } from "./support/lab.js";
import { endAll, programFolder, run, start } from "./support/programs.js";

// Against RTPM's own programs: the registry, a device server and the tool.

const ArmPart = { ...Arm, methods: [add, get] };

async function serveArm(answer: number): Promise<Server> {
  const server = await Server.listen();
  server.add(
    "arm",
    skeleton(ArmPart, [operation(add, (value) => value + 1), operation(get, () => answer)]),
  );
  return server;
}

describe("beside RTPM's programs", { skip: programFolder === undefined }, () => {
  let registry = "";
  const nodes: Node[] = [];
  const newNode = (transport: "udp" | "tcp"): Node => {
    const node = new Node({ transport, registries: [registry], deadlineMs: 5000 });
    nodes.push(node);
    return node;
  };

  before(async () => {
    registry = await start("rtpm-registryd", ["--port", "0"], /(rtpm:\S+)/);
    const options = [
      "--registry",
      registry,
      "--events",
      "none",
      "--stops",
      "none",
      "--settings",
      "",
    ];
    await start("rtpm-deviced", options, /(serving lab\/arm0)/);
  });
  after(async () => {
    for (const node of nodes) await node.close();
    await endAll();
  });

  for (const transport of ["udp", "tcp"] as const) {
    test(`a device by its name, over ${transport}`, async () => {
      const node = newNode(transport);
      const arm = new DeviceClient(await node.bind("lab/arm0", DeviceInterface));
      // The schema's own deadlines are a few ms, which a busy machine may need.
      const options = { deadlineMs: 5000 };
      const description = await arm.describe(options);
      assert.notEqual(description.model, "");
      const first = await arm.read(options);
      await sleep(20);
      const second = await arm.read(options);
      assert.ok(second.sequence > first.sequence);
      assert.ok(Number.isFinite(second.positionM.x));
    });

    test(`the names, and a watch of them, over ${transport}`, async () => {
      const node = newNode(transport);
      assert.deepEqual(
        (await node.names.list("lab")).map((entry) => entry.name),
        ["lab/arm0"],
      );
      const refused = (name: string, outcome: string, words: RegExp): Promise<void> =>
        assert.rejects(node.names.resolve(name), (error) => {
          assert.ok(error instanceof NameError);
          assert.equal(error.outcome, outcome);
          assert.match(error.message, words);
          return true;
        });
      const unbound = `^lab/nothing: no server has bound this name at .* ${registry};.*names.list`;
      await refused("lab/nothing", "NotFound", new RegExp(unbound));
      await refused("lab", "IsADirectory", /^lab: it is a directory .*names\.list\("lab"\)/);
      await refused("lab/arm0/config", "NotADirectory", /a name above it is bound/);
      await refused("a/b/c/d/e/f/g/h/i", "BadName", /1 to 8 parts/);
      const names = new NamesClient(await node.bind(registry, NamesInterface));
      const seen: string[] = [];
      const server = await serveArm(1);
      for await (const item of names.watch(WatchRequest.of({ directory: "live" }))) {
        for (const change of item.changes) seen.push(`${change.kind} ${change.entry.name}`);
        if (item.phase === WatchPhase.StateEnd) {
          const url = server.addressOf("arm");
          const kept = await node.names.bindName(`live/${transport}`, url, ArmPart);
          await kept.close();
        }
        if (seen.length === 2) break;
      }
      assert.deepEqual(seen, [`0 live/${transport}`, `2 live/${transport}`]);
      await server.close();
    });
  }

  test("a server of ours is found by the tool", async () => {
    const node = newNode("udp");
    const server = await serveArm(7);
    const kept = await node.names.bindName("live/arm", server.addressOf("arm"), ArmPart);
    const resolved = await run("rtpm", ["resolve", "live/arm"], registry);
    assert.equal(resolved.trim(), server.addressOf("arm"));
    assert.match(await run("rtpm", ["list"], registry), /live\/arm +lab\.Arm/);
    await kept.close();
    await assert.rejects(run("rtpm", ["resolve", "live/arm"], registry));
    await server.close();
  });

  test("the tool describes and calls a server of ours", async () => {
    const server = await Server.listen();
    server.add("other", otherSkeleton({ nothing: () => undefined }));
    server.add("interop", interopSkeleton(new InteropServer(undefined)));
    const url = server.addressOf("interop");
    const tool = (...args: string[]): Promise<string> => run("rtpm", args, registry);
    const info = await tool("info", url);
    assert.match(info, /interface +rtpm\.interop\.Interop\n/);
    assert.match(info, /count_up \(stream\)/);
    assert.match(await tool("info", url, "--schema"), /rpc_service Interop/);
    assert.equal(await tool("call", url, "add", '{"count": 5}'), '{"count": 5}\n');
    assert.match(await tool("call", url, "count_up", '{"count": 2}'), /0}\n.*1}\n$/s);
    await assert.rejects(tool("call", url, "refuse", '{"text": "not now"}'), /not now/);

    const node = newNode("udp");
    const at = server.addressOf("rtpm/introspection");
    const objects = new IntrospectionClient(await node.bind(at, IntrospectionInterface));
    assert.deepEqual(await objects.list(), {
      objects: [
        { path: "interop", interface: "rtpm.interop.Interop" },
        { path: "other", interface: "rtpm.interop.Other" },
      ],
    });
    const refused = (request: Partial<DescribeRequest>, code: string): Promise<void> =>
      assert.rejects(objects.describe(DescribeRequest.of(request)), { code });
    await refused({ path: "nothing" }, "gone");
    await refused({ interface: "rtpm.Nothing" }, "gone");
    await refused({}, "bad_request");
    await server.close();
  });

  test("a lease is renewed, and lapses without its owner", async () => {
    const node = newNode("udp");
    const url = "rtpm://127.0.0.1:9/arm";
    const kept = await node.names.bindName("live/lease", url, ArmPart, { leaseMs: 300 });
    await sleep(900);
    assert.equal((await node.names.resolve("live/lease")).url, url);
    const other = node.names.bindName("live/lease", url, ArmPart, { leaseMs: 300 });
    await assert.rejects(other, (error) => {
      assert.ok(error instanceof NameError);
      assert.equal(error.outcome, "AlreadyBound");
      assert.ok(error.message.includes(`bound this name to ${url}`), error.message);
      return true;
    });
    await kept.close();
    await assert.rejects(node.names.resolve("live/lease"), { outcome: "NotFound" });
  });

  test("a binding follows its name to another server", async () => {
    const node = newNode("tcp");
    const first = await serveArm(1);
    const options = { allowTakeover: true, onTrouble: () => undefined };
    const url = first.addressOf("arm");
    const kept = await node.names.bindName("live/moving", url, ArmPart, options);
    const arm = await node.bind("live/moving", ArmPart);
    assert.equal(await arm.call(get, undefined), 1);
    const second = await serveArm(2);
    const moved = await node.names.bindName(
      "live/moving",
      second.addressOf("arm"),
      ArmPart,
      options,
    );
    await first.close();
    assert.equal(await arm.call(get, undefined), 2);
    await moved.close();
    await kept.close();
    await second.close();
  });

  test("a name that leads nowhere", async () => {
    const node = newNode("tcp");
    const url = "rtpm://127.0.0.1:1/arm";
    const kept = await node.names.bindName("live/nowhere", url, ArmPart);
    await assert.rejects(
      node.bind("live/nowhere", ArmPart, { deadlineMs: 300 }),
      (error) => error instanceof CallError && error.code === "unreachable",
    );
    await kept.close();
  });
});

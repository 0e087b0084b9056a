import assert from "node:assert/strict";
import { execFile } from "node:child_process";
import { after, before, describe, test } from "node:test";
import { setTimeout as sleep } from "node:timers/promises";
import { promisify } from "node:util";
import {
  ConfigurationClient,
  ConfigurationInterface,
  OutcomeCode,
  Setting,
  Value,
} from "../idl/configuration.rtpm.js";
import { CommandMode } from "../idl/device.rtpm.js";
import { HubClient, HubInterface } from "../idl/events.rtpm.js";
import { MeasuredEvent, type Measured } from "../idl/tests/interop.rtpm.js";
import {
  Device,
  DeviceError,
  EventConsumer,
  EventFilter,
  EventSupplier,
  Fault,
  Lifecycle,
  Node,
  faultNames,
  type EventType,
  type HubEvent,
} from "../src/index.js";
import { endAll, programFolder, run, start } from "./support/programs.js";

// Events and devices, with RTPM's own registry, hub, device server and tool.

async function take(consumer: EventConsumer, count: number): Promise<HubEvent[]> {
  const events: HubEvent[] = [];
  const timer = setTimeout(() => void consumer.close(), 10_000);
  for await (const event of consumer) {
    events.push(event);
    if (events.length === count) break;
  }
  clearTimeout(timer);
  return events;
}
const levels = (events: HubEvent[]): number[] =>
  events.map((event) => event.value(MeasuredEvent).level);

const refusedAs =
  (outcome: string) =>
  (error: unknown): boolean =>
    error instanceof DeviceError && error.outcome === outcome;

describe("a laboratory of RTPM's programs", { skip: programFolder === undefined }, () => {
  let registry = "";
  let node: Node;
  let other: Node;
  // A command has 10 ms, which a busy machine may take for itself.
  const patient = { deadlineMs: 5000 };

  before(async () => {
    registry = await start("rtpm-registryd", ["--port", "0"], /(rtpm:\S+)/);
    await start("rtpm-eventd", ["--registry", registry, "--port", "0"], /(rtpm:\S+)/);
    const options = ["--registry", registry, "--events", "none", "--stops", "none"];
    await start("rtpm-deviced", [...options, "--settings", ""], /(serving lab\/arm0)/);
    const newNode = (transport: "udp" | "tcp"): Node =>
      new Node({ transport, registries: [registry], deadlineMs: 5000 });
    node = newNode("udp");
    other = newNode("tcp");
  });
  after(async () => {
    await node.close();
    await other.close();
    await endAll();
  });

  const open = (filter: EventFilter, window = 256): Promise<EventConsumer> =>
    EventConsumer.open(node, "rtpm/events", { name: "test", filter, window });
  const supply = (): Promise<EventSupplier> =>
    EventSupplier.open(other, "rtpm/events", "test", [MeasuredEvent]);
  const measured = (level: number): Measured => ({ level, text: "soft" });

  test("events that a filter accepts, in order", async () => {
    const { any, all, not, of, where } = EventFilter;
    const low = where(MeasuredEvent, "level", "<", 3);
    await using some = await open(all(of(MeasuredEvent, 9), any(low, not(low)), not(low)));
    const supplier = await supply();
    for (let i = 0; i < 6; i += 1) supplier.push(MeasuredEvent, 9, measured(i));
    supplier.push(MeasuredEvent, 8, measured(7));
    supplier.push(MeasuredEvent, 9, measured(8));
    const events = await take(some, 4);
    assert.deepEqual(levels(events), [3, 4, 5, 8]);
    const [first] = events;
    assert.equal(first?.source, 9);
    assert.equal(first?.sequence, 4n);
    assert.ok(first.sentNs >= first.receivedNs && first.receivedNs >= first.originNs);
    assert.equal((await supplier.counts()).taken, 8n);
    assert.deepEqual([some.received, some.lost, some.malformed, some.trouble], [4n, 0n, 0, ""]);
  });

  test("a slow program keeps the newest events of its window, and counts the others", async () => {
    await using some = await open(EventFilter.of(MeasuredEvent), 8);
    const supplier = await supply();
    for (let i = 0; i < 1000; i += 1) {
      supplier.push(MeasuredEvent, 1, measured(i));
      if (i % 20 === 0) await sleep(1); // a push has 100 ms, also on a busy machine
    }
    await sleep(300);
    const { taken } = await supplier.counts();
    const got: number[] = [];
    const reading = (async () => {
      for await (const event of some) got.push(event.value(MeasuredEvent).level);
    })();
    const isWhole = (): boolean => BigInt(got.length) + some.lost === taken;
    for (let i = 0; i < 250 && !isWhole(); i += 1) await sleep(20);
    assert.ok(isWhole(), `${got.length} came and ${some.lost} were lost of ${taken}`);
    assert.ok(got.length < 500, `${got.length} events came`);
    await some.close();
    await reading;
  });

  test("close() ends the loop and the hub's subscription", async () => {
    const some = await open(EventFilter.everything());
    const hub = new HubClient(await node.bind("rtpm/events", HubInterface));
    const names = async (): Promise<string[]> =>
      (await hub.report()).subscriptions.map((one) => one.name);
    assert.deepEqual(await names(), ["test"]);
    const loop = take(some, 1);
    await some.close();
    assert.deepEqual(await loop, []);
    assert.deepEqual(await names(), []);
    assert.equal((await hub.report()).disconnects.at(-1)?.cause, 0);
  });

  test("a consumer subscribes again at a hub that was restarted elsewhere", async () => {
    await using some = await open(EventFilter.of(MeasuredEvent));
    const supplier = await supply();
    await endAll("rtpm-eventd");
    for (let i = 0; i < 500 && some.trouble === ""; i += 1) await sleep(10);
    assert.notEqual(some.trouble, "");
    await start("rtpm-eventd", ["--registry", registry, "--port", "0"], /(rtpm:\S+)/);
    for (let i = 0; i < 1000 && some.trouble !== ""; i += 1) await sleep(10);
    assert.equal(some.trouble, "");
    await supplier.counts(); // states the types again
    supplier.push(MeasuredEvent, 1, measured(3));
    assert.deepEqual(levels(await take(some, 1)), [3]);
  });

  test("a filter that cannot be is refused", async () => {
    const field = "nothing" as "level";
    assert.throws(() => EventFilter.where(MeasuredEvent, field, "<", 1), /no number nothing/);
    const abort = AbortSignal.abort();
    await assert.rejects(EventConsumer.open(node, "rtpm/events", { signal: abort }));
    const bad: EventType<Measured> = { ...MeasuredEvent, fields: [...MeasuredEvent.fields] };
    const clash = { ...bad, type: 0 };
    await assert.rejects(EventSupplier.open(node, "rtpm/events", "bad", [clash]), /hub/);
  });

  test("the tool prints what a supplier pushes", async () => {
    const supplier = await supply();
    const printed = run("rtpm", ["echo", "--count", "1", "--for", "10s"], registry);
    const pushing = setInterval(() => supplier.push(MeasuredEvent, 1, measured(42)), 50);
    try {
      assert.match(await printed, /42.*soft/s);
    } finally {
      clearInterval(pushing);
    }
  });

  test("one client at a time commands a device", async () => {
    const arm = await Device.open(node, "lab/arm0");
    const same = await Device.open(other, "lab/arm0");
    const down = { x: 0, y: 0, z: -1 };
    {
      await using lease = await arm.acquire({ patienceMs: 1000 });
      await lease.force(down, 20, patient);
      await assert.rejects(same.acquire({ patienceMs: 200 }), refusedAs("Held"));
      await assert.rejects(same.acquire(), /patienceMs/);
      const wrong = lease.command({ mode: CommandMode.JointEffort }, 20, patient);
      await assert.rejects(wrong, /see description\.modes/);
      await same.emergencyStop();
      await assert.rejects(lease.force(down, 20, patient), refusedAs("EmergencyStop"));
      await lease.rearm();
      await lease.force(down, 20, patient);
      assert.equal(lease.trouble, "");
      await assert.rejects(lease.force(down, 0), RangeError);
    }
    await using lease = await same.acquire({ patienceMs: 2000 });
    await lease.force(down, 20, patient);
    await sleep(1500); // longer than a lease without renewals
    await lease.force(down, 20, patient);
    assert.ok(!lease.signal.aborted);
  });

  test("a force shows in the samples, and is gone after its time", async () => {
    const arm = await Device.open(node, "lab/arm0");
    await using lease = await arm.acquire({ patienceMs: 2000 });
    await lease.force({ x: 0, y: 0, z: 1 }, 100, patient);
    const seen: boolean[] = [];
    let last = 0n;
    for await (const { sequence, forceNewton } of arm.samples({ intervalMs: 5 })) {
      assert.ok(sequence > last);
      last = sequence;
      const isThere = forceNewton.z !== 0;
      if (seen.at(-1) !== isThere) seen.push(isThere);
      if (!isThere && seen.includes(true)) break;
    }
    assert.ok(seen.includes(true));
  });

  test("rearm() and recover() resolve when the device shows it", async () => {
    const arm = await Device.open(node, "lab/arm0");
    await using lease = await arm.acquire({ patienceMs: 2000 });
    for (let i = 0; i < 5; i += 1) {
      await arm.emergencyStop();
      await lease.rearm();
      assert.equal((await arm.read()).faults & Fault.EmergencyStop, 0);
      await lease.recover();
      assert.equal((await arm.read()).faults & Fault.EmergencyStop, 0);
    }
    const nothing = { x: NaN, y: 0, z: 0 };
    await assert.rejects(lease.force(nothing, 20, patient), refusedAs("NotFinite"));
    await sleep(20);
    await lease.force({ x: 1, y: 0, z: 0 }, 20, patient); // resolves, and has no effect
    const { faults, forceNewton } = await arm.read();
    assert.ok(faultNames(faults).includes("CommandNotFinite"));
    assert.equal(forceNewton.x, 0);
    await lease.recover();
    assert.equal((await arm.read()).faults & Fault.CommandNotFinite, 0);
    await lease.deactivate();
    assert.equal((await arm.read()).lifecycle, Lifecycle.Inactive);
    await lease.activate();
    assert.equal((await arm.read()).lifecycle, Lifecycle.Active);
  });

  // A program of its own, as a process that does not end is what this is about.
  const endsAfter = async (use: string): Promise<unknown> => {
    const url = new URL("../src/index.js", import.meta.url);
    const program = `
      import { Device, EventConsumer, Node } from "${url.href}";
      const node = new Node({ registries: ["${registry}"], deadlineMs: 5000 });
      ${use}`;
    const args = ["--input-type=module", "--eval", program];
    const { stdout } = await promisify(execFile)(process.execPath, args, { timeout: 20_000 });
    return JSON.parse(stdout);
  };

  test("close() of a node ends its leases, and then the process ends", async () => {
    const use = `
      const arm = await Device.open(node, "lab/arm0");
      const lease = await arm.acquire({ patienceMs: 2000 });
      await node.close();
      console.log(lease.signal.aborted);`;
    assert.equal(await endsAfter(use), true);
    const arm = await Device.open(node, "lab/arm0");
    await using lease = await arm.acquire({ patienceMs: 500 }); // it was released
    assert.ok(!lease.signal.aborted);
  });

  test("close() of a node ends its consumers' loops, and then the process ends", async () => {
    const use = `
      const consumer = await EventConsumer.open(node, "rtpm/events");
      setTimeout(() => node.close(), 100);
      for await (const event of consumer);
      console.log(JSON.stringify(consumer.trouble));`;
    assert.equal(await endsAfter(use), "closed");
  });

  test("a lease that ended aborts its signal", async () => {
    const arm = await Device.open(node, "lab/arm0");
    const lease = await arm.acquire({ patienceMs: 2000 });
    await arm.client.release(lease.holder);
    await assert.rejects(lease.force({ x: 0, y: 0, z: 1 }, 20, patient), refusedAs("NotHolder"));
    assert.ok(lease.signal.aborted);
    await lease.close();
  });

  test("parameters change together, or not at all", async () => {
    const binding = await node.bind("lab/arm0/config", ConfigurationInterface);
    const configuration = new ConfigurationClient(binding);
    const { parameters, revision } = await configuration.list();
    const ramp = parameters.find(({ name }) => name === "safety.ramp_s")!;
    assert.deepEqual([ramp.unit, ramp.low <= ramp.value.real], ["s", true]);
    const apply = (real: number, since: bigint): ReturnType<typeof configuration.apply> => {
      const value = Value.of({ type: ramp.type, real });
      const settings = [Setting.of({ name: ramp.name, value })];
      return configuration.apply({ revision: since, settings }, patient);
    };
    const refused = await apply(ramp.high + 1, revision);
    assert.equal(refused.answer.outcome, OutcomeCode.OutOfRange);
    const middle = (ramp.low + ramp.high) / 2;
    const changed = await apply(middle, revision);
    assert.equal(changed.answer.outcome, OutcomeCode.Done);
    assert.equal(changed.settings[0]?.value.real, middle);
    const late = await apply(ramp.low, revision);
    assert.equal(late.answer.outcome, OutcomeCode.StaleRevision);
  });
});

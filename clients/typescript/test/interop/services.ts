import assert from "node:assert/strict";
import { randomUUID } from "node:crypto";
import { setTimeout as sleep } from "node:timers/promises";
import { InteropClient, InteropInterface, MeasuredEvent } from "../../idl/tests/interop.rtpm.js";
import { Device, DeviceError, EventConsumer, EventFilter, NameError } from "../../src/index.js";
import { Left, same, type Case, type Laboratory } from "./check.js";

// A busy machine may need more than the schema's own deadlines.
const patient = { deadlineMs: 5000 };

async function expectEvents({ interop, services, options }: Laboratory): Promise<void> {
  if (options.registry === undefined) throw new Left("skipped", "it needs --registry");
  const text = randomUUID();
  const filter = EventFilter.where(MeasuredEvent, "level", ">=", 5);
  await using consumer = await EventConsumer.open(services, "rtpm/events", {
    name: "interop",
    filter,
  });
  await interop.emit({ first: 0, count: 10, text });
  // Nothing else may follow.
  let timer = setTimeout(() => void consumer.close(), 10_000);
  const levels: number[] = [];
  for await (const event of consumer) {
    const value = event.value(MeasuredEvent);
    if (value.text !== text) continue;
    levels.push(value.level);
    if (levels.length !== 5) continue;
    clearTimeout(timer);
    timer = setTimeout(() => void consumer.close(), 100);
  }
  clearTimeout(timer);
  same(levels, [5, 6, 7, 8, 9], "the levels");
}

async function expectName({ url, node, services, options }: Laboratory): Promise<void> {
  const { name } = options;
  if (name === undefined) throw new Left("skipped", "it needs --name");
  await new InteropClient(await node.bind(name, InteropInterface)).add({ count: 0 });
  const own = `interop/${randomUUID()}`;
  const kept = await services.names.bindName(own, url, InteropInterface, { leaseMs: 1000 });
  await sleep(2500);
  same((await services.names.resolve(own)).url, url, "the address");
  await kept.close();
  await assert.rejects(
    services.names.resolve(own),
    (error) => error instanceof NameError && error.outcome === "NotFound",
  );
}

async function expectDevice(laboratory: Laboratory): Promise<void> {
  const { device: name } = laboratory.options;
  if (name === undefined) throw new Left("skipped", "it needs --device");
  await using other = laboratory.newServices();
  const device = await Device.open(laboratory.services, name);
  const again = await Device.open(other, name);
  {
    await using lease = await device.acquire({ patienceMs: 5000 });
    await assert.rejects(
      again.acquire({ patienceMs: 200 }),
      (error) => error instanceof DeviceError && error.outcome === "Held",
    );
    await lease.force({ x: 0, y: 0, z: 1 }, 100, patient);
    const signal = AbortSignal.timeout(5000);
    for await (const { forceNewton } of device.samples({ intervalMs: 5, signal })) {
      if (forceNewton.z !== 0) break;
    }
  }
  await using lease = await again.acquire({ patienceMs: 5000 });
  assert.ok(!lease.signal.aborted);
}

export const serviceCases: Record<string, Case> = {
  events: expectEvents,
  name: expectName,
  device: expectDevice,
};

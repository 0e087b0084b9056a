import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";
import {
  Command,
  Description,
  DeviceInterface,
  DeviceMethods,
  OutcomeCode,
  Sample,
} from "../idl/device.rtpm.js";
import {
  BadValue,
  Device,
  Fault,
  Lifecycle,
  Node,
  Server,
  faultNames,
  lifecycleName,
  operation,
  skeleton,
} from "../src/index.js";
import { specFolder } from "./support/vectors.js";

// Devices, without RTPM's programs.

function enumOf(header: string, name: string): Record<string, number> {
  const body = new RegExp(`enum class ${name} : [^{]*{([^}]*)}`).exec(header)?.[1] ?? "";
  const found: Record<string, number> = {};
  for (const [, key, value, bit] of body.matchAll(/\bk(\w+) =\s+(\d+)(?:u << (\d+))?/g)) {
    found[key!] = bit === undefined ? Number(value) : Number(value) << Number(bit);
  }
  return found;
}

test("faults and lifecycles are those of C++", () => {
  const path = join(specFolder, "..", "gvd", "driver", "include", "rtpm", "driver", "sample.hpp");
  const header = readFileSync(path, "utf8");
  assert.deepEqual(enumOf(header, "Fault"), Fault);
  assert.deepEqual(enumOf(header, "Lifecycle"), Lifecycle);
});

test("faults and lifecycles by name", () => {
  assert.deepEqual(faultNames(0), []);
  const faults = Fault.SoftStart | Fault.DeviceLate | (1 << 31);
  assert.deepEqual(faultNames(faults), ["DeviceLate", "SoftStart", "bit 31"]);
  assert.deepEqual([2, 9].map(lifecycleName), ["Active", "lifecycle 9"]);
});

const xyz = { x: 0, y: 0, z: 0 };

/** A device whose cycle is a reading, and which keeps an emergency stop. */
class StoppedDevice {
  released = 0;
  private sequence = 0n;
  /** @param cyclesToRearm  how many cycles still show the stop behind rearm() */
  constructor(private cyclesToRearm: number) {}

  addTo(server: Server): string {
    const done = { code: OutcomeCode.Done };
    const lease = { id: 1n, durationUs: 30_000n, idleUs: 5_000_000n, outcome: OutcomeCode.Done };
    const { describe, read, acquire, renew, release, rearm } = DeviceMethods;
    const description = Description.of({
      model: "none",
      serial: "1",
      frame: "arm/base",
      axes: [],
      buttons: [],
      analogs: [],
      workspaceLowM: xyz,
      workspaceHighM: xyz,
      joints: [],
      outputs: [],
      modes: new Uint8Array(0),
    });
    const operations = [
      operation(describe, () => description),
      operation(read, () => this.sample()),
      operation(acquire, () => lease),
      operation(renew, () => done),
      operation(release, () => {
        this.released += 1;
        return done;
      }),
      operation(rearm, () => done),
    ];
    const methods = [describe, read, acquire, renew, release, rearm];
    server.add("arm", skeleton({ ...DeviceInterface, methods }, operations));
    return server.addressOf("arm");
  }

  private sample(): Sample {
    this.sequence += 1n;
    this.cyclesToRearm -= 1;
    const zeros = Sample.codec.decode(new Uint8Array(Sample.codec.size));
    const faults = this.cyclesToRearm < 0 ? 0 : Fault.EmergencyStop;
    return { ...zeros, sequence: this.sequence, faults, lifecycle: Lifecycle.Active };
  }
}

test("rearm() waits for a sample without the stop, and no longer than 500 ms", async () => {
  await using server = await Server.listen();
  await using node = new Node();
  const arm = await Device.open(node, new StoppedDevice(10).addTo(server));
  await using lease = await arm.acquire();
  await lease.rearm();
  assert.equal((await arm.read()).sequence, 12n); // the one without the stop was the eleventh
});

test("rearm() says that the stop stays", async () => {
  await using server = await Server.listen();
  await using node = new Node();
  const arm = await Device.open(node, new StoppedDevice(Infinity).addTo(server));
  await using lease = await arm.acquire();
  const begun = Date.now();
  const message = /rearm: .* after 500 ms its samples show: Active, EmergencyStop/;
  await assert.rejects(lease.rearm(), { code: "timeout", wasRun: true, message });
  assert.ok(Date.now() - begun >= 490);
});

test("a node's close() releases its leases", async () => {
  await using server = await Server.listen();
  const device = new StoppedDevice(0);
  const node = new Node();
  const arm = await Device.open(node, device.addTo(server));
  const [closed, open] = [await arm.acquire(), await arm.acquire()];
  await closed.close();
  assert.deepEqual([device.released, open.signal.aborted], [1, false]);
  await node.close();
  assert.deepEqual([device.released, open.signal.aborted], [2, true]);
});

test("a refused command names the field", () => {
  const command: Command = {
    forceNewton: xyz,
    torqueNewtonMetre: xyz,
    positionM: xyz,
    orientation: { ...xyz, w: 1 },
    linearMPerS: xyz,
    angularRadPerS: xyz,
    joints: new Float64Array(8),
    outputs: new Float32Array(8),
    lease: 1n,
    sequence: 1,
    holdUs: 1,
    mode: 1,
  };
  assert.equal(Command.codec.encode(command).length, Command.codec.size);
  const refused = (fields: object, message: string): void => {
    const wrong = { ...command, ...fields };
    const expected = { name: "BadValue", message: `rtpm.device.Command: ${message}` };
    assert.throws(() => Command.codec.encode(wrong), expected);
    assert.throws(() => Command.codec.encode(wrong), BadValue);
  };
  refused({ forceNewton: { x: 0, z: 0 } }, "forceNewton.y: undefined is no number");
  refused({ positionM: { ...xyz, z: "0.5" } }, 'positionM.z: "0.5" is no number');
  refused({ torqueNewtonMetre: undefined }, "torqueNewtonMetre: undefined is no struct");
  refused({ joints: new Float64Array(7) }, "joints: an array has 7 elements, not 8");
  refused({ holdUs: -1 }, "holdUs: -1 is no integer within 0 to 4294967295");
});

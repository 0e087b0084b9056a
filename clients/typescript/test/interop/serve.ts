import { setTimeout as sleep } from "node:timers/promises";
import {
  InteropInterface,
  MeasuredEvent,
  Reason,
  interopSkeleton,
  otherSkeleton,
  type Bytes,
  type Count,
  type Emission,
  type InteropServant,
  type Item,
  type Notes,
  type Numbers,
  type Pause,
  type Pausing,
  type Priority,
  type Range,
  type Refusal as AskedRefusal,
  type Values,
} from "../../idl/tests/interop.rtpm.js";
import {
  EventSupplier,
  Node,
  Refusal,
  Server,
  type CallContext,
  type StatusName,
} from "../../src/index.js";
import { toHex } from "../../src/core/bytes.js";
import type { Options } from "./options.js";

const reasons = new Map<number, StatusName>(
  Object.entries(Reason).map(([name, number]) => [number, name as StatusName]),
);

export class InteropServer implements InteropServant {
  private sum = 0;
  private noted = 0;
  private streamCount = 0;
  private supplier: Promise<EventSupplier> | undefined;

  /** @param node  of the hub, if there is one */
  constructor(private readonly node: Node | undefined) {}

  echoNumbers(request: Numbers): Numbers {
    return request;
  }
  echoValues(request: Values): Values {
    return request;
  }
  echoBytes(request: Bytes): Bytes {
    return request;
  }
  add({ count }: Count): Count {
    this.sum += count;
    return { count: this.sum };
  }
  refuse({ reason, text }: AskedRefusal): never {
    throw new Refusal(reasons.get(reason) as Exclude<StatusName, "ok">, text);
  }
  async wait({ milliseconds }: Pause, { signal }: CallContext): Promise<void> {
    await sleep(milliseconds, undefined, { signal });
  }
  // All calls run on this thread, which is the lane.
  hold({ milliseconds }: Pause): Pausing {
    Atomics.wait(new Int32Array(new SharedArrayBuffer(4)), 0, 0, milliseconds);
    return { wasAlone: true };
  }
  noteSent(): void {
    this.noted += 1;
  }
  noteReceived(): void {
    this.noted += 1;
  }
  noteDone(): void {
    this.noted += 1;
  }
  notes(): Notes {
    return { count: this.noted };
  }
  async *countUp({ count, padding, failure }: Range): AsyncGenerator<Item> {
    this.streamCount += 1;
    try {
      for (let number = 0; count === 0 || number < count; number += 1) {
        yield { number, padding: new Uint8Array(padding) };
      }
      if (failure !== "") throw new Refusal("servant_failed", failure);
    } finally {
      this.streamCount -= 1;
    }
  }
  streams(): Count {
    return { count: this.streamCount };
  }
  priority({ priority }: CallContext): Priority {
    return { priority };
  }
  async emit({ first, count, text }: Emission, { signal }: CallContext): Promise<void> {
    if (this.node === undefined) throw new Refusal("bad_request", "serve has no --registry");
    this.supplier ??= EventSupplier.open(this.node, "rtpm/events", "interop", [MeasuredEvent]);
    const supplier = await this.supplier;
    const { taken } = await supplier.counts({ signal });
    for (let i = 0; i < count; i += 1) supplier.push(MeasuredEvent, 0, { level: first + i, text });
    while ((await supplier.counts({ signal })).taken < taken + BigInt(count)) {
      await sleep(2, undefined, { signal });
    }
  }
}

/** Serves until the input ends. */
export async function serve({ own, other, registry, name }: Options): Promise<void> {
  const admits = (key: Uint8Array): boolean => other !== undefined && toHex(key) === toHex(other);
  const server = await Server.listen(own === undefined ? {} : { keys: { own, admits } });
  // Nothing that goes to the hub is lost over TCP.
  const node =
    registry === undefined ? undefined : new Node({ transport: "tcp", registries: [registry] });
  server.add("interop", interopSkeleton(new InteropServer(node)));
  server.add("interop/other", otherSkeleton({ nothing: () => undefined }));
  const url = server.addressOf("interop");
  if (name !== undefined) await node?.names.bindName(name, url, InteropInterface);
  process.stdout.write(`${JSON.stringify({ udp: url, tcp: url })}\n`);
  process.stdin.resume();
  await new Promise((resolve) => process.stdin.once("end", resolve));
  await node?.close();
  await server.close();
}

// Uses that `tsc` must refuse: each line below a mark is an error, or the build fails.
import { DeviceClient, DeviceInterface, type Sample } from "../idl/device.rtpm.js";
import {
  InteropClient,
  InteropInterface,
  InteropMethods,
  MeasuredEvent,
  Values,
  interopSkeleton,
  type InteropServant,
  type Item,
  type Numbers,
  type Shape,
} from "../idl/tests/interop.rtpm.js";
import {
  CallError,
  Device,
  EventConsumer,
  EventFilter,
  EventSupplier,
  Node,
  Refusal,
  operation,
  skeleton,
  type EventType,
} from "../src/index.js";

/** Never called. */
export async function wrongUses(node: Node, servant: InteropServant): Promise<void> {
  const binding = await node.bind("interop", InteropInterface);
  const interop = new InteropClient(binding);
  const device = await Device.open(node, "lab/arm0");

  // Values.
  // @ts-expect-error a required field is absent
  Values.of({ level: 1 });
  // @ts-expect-error the schema has no such field
  Values.of({ text: "", levle: 1 });
  // @ts-expect-error 64 bits are a bigint
  Values.of({ text: "", maybe: 1 });
  // @ts-expect-error a vector of numbers is a typed array
  Values.of({ text: "", reals: [1, 2] });
  // @ts-expect-error of another type
  Values.of({ text: "", reals: new Float32Array(2) });
  // @ts-expect-error a union's member has its own value
  const shape: Shape = { type: "Corner", value: { name: "", weight: undefined } };
  // @ts-expect-error a struct needs all of its fields
  const numbers: Numbers = { i8: 1 };

  // Calls.
  // @ts-expect-error the interface has no such method
  await interop.ad({ count: 1 });
  // @ts-expect-error another request
  await interop.add({ milliseconds: 1 });
  // @ts-expect-error a request is needed
  await interop.add();
  // @ts-expect-error the method takes none
  await interop.notes({ count: 1 });
  // @ts-expect-error the reply has no such field
  (await interop.add({ count: 1 })).sum;
  // @ts-expect-error the option is deadlineMs
  await interop.notes({ deadline: 100 });
  // @ts-expect-error nothing comes back from a oneway
  await interop.noteSent({ number: 1 }).then(() => undefined);
  // @ts-expect-error a stream is no promise
  await interop.countUp({ count: 1, padding: 0, failure: "" }).then(() => undefined);
  // @ts-expect-error the method's request, also without a generated client
  await binding.call(InteropMethods.add, { milliseconds: 1 });
  // @ts-expect-error an interface, and no client
  await node.bind("lab/arm0", DeviceClient);
  // @ts-expect-error the transport is udp or tcp
  new Node({ transport: "quic" });
  // @ts-expect-error no such status
  new Refusal("bad", "why");
  // @ts-expect-error no failure has this code
  new CallError("timeout", "", "").code === "late";

  // Servants.
  // @ts-expect-error all methods are needed
  const half: InteropServant = { add: ({ count }) => ({ count }) };
  // @ts-expect-error another reply
  const other: InteropServant = { ...servant, add: () => ({ sum: 1 }) };
  // @ts-expect-error a stream gives items
  const single: InteropServant = { ...servant, countUp: (): Item => ({}) as Item };
  // @ts-expect-error function and method do not agree
  operation(InteropMethods.add, ({ milliseconds }) => ({ count: milliseconds }));
  // @ts-expect-error a skeleton's interface comes first
  skeleton([], InteropInterface);
  // @ts-expect-error an object of all methods
  interopSkeleton({});

  // Events.
  // @ts-expect-error the event has no such number
  EventFilter.where(MeasuredEvent, "levle", ">=", 5);
  // @ts-expect-error a text is no number
  EventFilter.where(MeasuredEvent, "text", "==", 5);
  // @ts-expect-error no such comparison
  EventFilter.where(MeasuredEvent, "level", "=>", 5);
  // @ts-expect-error a number is compared with a number
  EventFilter.where(MeasuredEvent, "level", ">=", "5");
  const supplier = await EventSupplier.open(node, "rtpm/events", "test", [MeasuredEvent]);
  // @ts-expect-error another event's value
  supplier.push(MeasuredEvent, 0, { count: 1 });
  const consumer = await EventConsumer.open(node, "rtpm/events");
  for await (const event of consumer) {
    // @ts-expect-error the value has no such field
    event.value(MeasuredEvent).levle;
  }
  // @ts-expect-error a consumer is closed asynchronously
  using once = consumer;
  // @ts-expect-error an event of another value
  const wrong: EventType<Sample> = MeasuredEvent;

  // Devices.
  await using lease = await device.acquire();
  // @ts-expect-error a command holds for a stated time
  await lease.force({ x: 0, y: 0, z: 1 });
  // @ts-expect-error a force has three components
  await lease.force({ x: 0, y: 0 }, 20);
  // @ts-expect-error the lease adds its own number
  await lease.command({ mode: 1, lease: 5n }, 20);
  // @ts-expect-error samples are not changed by what they come as
  (await device.read()).sequence = 5;
  void [shape, numbers, half, other, single, once, wrong, DeviceInterface];
}

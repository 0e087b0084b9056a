import assert from "node:assert/strict";
import { setTimeout as sleep } from "node:timers/promises";
import {
  Color,
  InteropInterface,
  Reason,
  Values,
  type Numbers,
  type Shape,
} from "../../idl/tests/interop.rtpm.js";
import { BadValue, CallError } from "../../src/index.js";
import { Left, failure, same, until, type Case, type Laboratory } from "./check.js";

const int64Min = -(2n ** 63n);
const refusalText = "größer als 5";

function numbers(fields: Partial<Numbers>): Numbers {
  return {
    i8: 0,
    u8: 0,
    i16: 0,
    u16: 0,
    i32: 0,
    u32: 0,
    i64: 0n,
    u64: 0n,
    f32: 0,
    f64: 0,
    flag: false,
    color: Color.Red,
    at: { x: 0, y: 0, z: 0 },
    three: Uint16Array.of(0, 0, 0),
    ...fields,
  };
}

const floatMax = 3.4028234663852886e38;
const numbersToEcho = [
  numbers({ i8: -0x80, i16: -0x8000, i32: -0x8000_0000, i64: int64Min }),
  numbers({
    i8: 0x7f,
    u8: 0xff,
    i16: 0x7fff,
    u16: 0xffff,
    i32: 0x7fff_ffff,
    u32: 0xffff_ffff,
    i64: 2n ** 63n - 1n,
    u64: 2n ** 64n - 1n,
    f32: floatMax,
    f64: Number.MAX_VALUE,
    flag: true,
    color: Color.Blue,
    at: { x: 1, y: -2.5, z: 1e-300 },
    three: Uint16Array.of(0, 1, 0xffff),
  }),
  numbers({ i8: -1, u8: 128, i16: -300, u16: 40_000, i32: 70_000, u64: 2n ** 53n + 1n }),
  numbers({ f32: -floatMax, f64: -Number.MAX_VALUE }),
  numbers({ f32: NaN, f64: NaN, at: { x: NaN, y: -0, z: Infinity } }),
  numbers({ f32: -0, f64: -0, i64: -1n }),
  numbers({ f32: Infinity, f64: Infinity }),
  numbers({ f32: -Infinity, f64: -Infinity }),
];

const shapes: Shape[] = [
  { type: "Leaf", value: { name: "a", weight: 0 } },
  { type: "Corner", value: { x: 1, y: 2, z: 3 } },
];

function fullValues(shape: Shape): Values {
  return {
    text: "naïve 触覚 🖐",
    absent: "not absent",
    texts: ["one", "", "naïve 触覚 🖐"],
    reals: Float64Array.from({ length: 100 }, (_, i) => i / 7),
    bytes: Uint8Array.from({ length: 256 }, (_, i) => i),
    longs: BigUint64Array.of(0n, 1n, 2n ** 64n - 1n),
    vectors: [
      { x: 1, y: 2, z: 3 },
      { x: -0, y: 1e300, z: -1 },
    ],
    leaves: [
      { name: "", weight: undefined },
      { name: "leaf", weight: 2.5 },
    ],
    colors: Uint8Array.of(Color.Red, Color.Blue, Color.Green),
    shape,
    color: Color.Red,
    level: 5,
    maybe: 0n,
    newton: -20,
  };
}

async function expectRange({ interop }: Laboratory): Promise<void> {
  const passed = await interop.echoValues(Values.of({ text: "", newton: 20 }));
  same(passed.newton, 20, "newton");
  try {
    await interop.echoValues(Values.of({ text: "", newton: 20.5 }));
  } catch (error) {
    if (error instanceof BadValue) return;
    assert.ok(error instanceof CallError);
    same([error.code, error.wasRun], ["bad_request", false], "the refusal");
    return;
  }
  assert.fail("newton 20.5 was not refused");
}

async function expectRefusals({ interop }: Laboratory): Promise<void> {
  for (const [name, reason] of Object.entries(Reason)) {
    const error = await failure(interop.refuse({ reason, text: refusalText }));
    same(error.code, name, "the status");
    same(error.wasRun === true, name === "servant_failed", `${name} says that the method ran`);
    const hasText = name === "bad_request" || name === "servant_failed";
    if (hasText) assert.ok(error.message.includes(refusalText), error.message);
  }
}

const anotherTimeout = new Set(["timeout", "expired"]);

async function expectDeadline({ interop }: Laboratory): Promise<void> {
  const begun = performance.now();
  const error = await failure(interop.wait({ milliseconds: 500 }, { deadlineMs: 100 }));
  const took = performance.now() - begun;
  assert.ok(anotherTimeout.has(error.code) || error.code === "cancelled", error.message);
  assert.ok(took >= 50 && took <= 450, `it took ${took} ms`);
  await interop.notes();
}

async function expectCancel({ interop, options }: Laboratory): Promise<void> {
  const abort = new AbortController();
  const milliseconds = options.isLossy ? 300 : 3000;
  const call = interop.wait({ milliseconds }, { signal: abort.signal });
  setTimeout(() => abort.abort(), 50);
  const begun = performance.now();
  await assert.rejects(call, { name: "AbortError" });
  const took = performance.now() - begun;
  assert.ok(took <= 500, `it took ${took} ms`);
  // A CANCEL that is lost leaves the call its place.
  if (options.isLossy) await sleep(300);
  await interop.notes();
}

async function expectExpired({ interop, options }: Laboratory): Promise<void> {
  if (options.isLossy) throw new Left("skipped", "add may come before hold");
  const { count: before } = await interop.add({ count: 0 });
  const holding = interop.hold({ milliseconds: 400 });
  await sleep(50);
  const late = interop.add({ count: 1 }, { deadlineMs: 100 }).then(
    () => undefined,
    (error: unknown) => error as CallError,
  );
  const { wasAlone } = await holding;
  const error = await late;
  if (!wasAlone) throw new Left("not_offered", "other calls run while one holds its lane");
  assert.ok(error !== undefined && anotherTimeout.has(error.code), String(error));
  same((await interop.add({ count: 0 })).count, before, "the sum");
}

async function expectOneways({ interop, options }: Laboratory): Promise<void> {
  const { count: before } = await interop.notes();
  for (let number = 0; number < 10; number += 1) {
    interop.noteSent({ number });
    await interop.noteReceived({ number });
    await interop.noteDone({ number });
  }
  let noted = 0;
  const least = options.isLossy ? 20 : 30;
  await until(async () => (noted = (await interop.notes()).count - before) >= least, 2000);
  assert.ok(noted >= least && noted <= 30, `${noted} of 30 were noted`);
}

export const callCases: Record<string, Case> = {
  numbers: async ({ interop }) => {
    for (const value of numbersToEcho) same(await interop.echoNumbers(value), value, "the echo");
  },
  values: async ({ interop }) => {
    const bare = Values.of({ text: "alone" });
    same([bare.color, bare.level], [Color.Green, -3], "the defaults");
    for (const value of [...shapes.map(fullValues), bare]) {
      same(await interop.echoValues(value), value, "the echo");
    }
  },
  range: expectRange,
  large: async ({ interop }) => {
    for (const size of [0, 1, 1400, 1_048_576]) {
      const bytes = Uint8Array.from({ length: size }, (_, i) => i ^ (i >> 8));
      const reply = await interop.echoBytes({ bytes });
      assert.ok(Buffer.from(reply.bytes).equals(bytes), `${size} bytes differ`);
    }
  },
  too_large: async ({ interop }) => {
    const error = await failure(interop.echoBytes({ bytes: new Uint8Array(1_100_001) }));
    same(error.code, "too_large", "the status");
    same(
      (await interop.echoBytes({ bytes: Uint8Array.of(1) })).bytes,
      Uint8Array.of(1),
      "the echo",
    );
  },
  refusals: expectRefusals,
  no_such_object: async ({ node, url }) => {
    const error = await failure(node.bind(`${url}/nothing`, InteropInterface));
    same(error.code, "no_such_object", "the status");
  },
  wrong_interface: async ({ node, url }) => {
    const error = await failure(node.bind(`${url}/other`, InteropInterface));
    same(error.code, "interface_mismatch", "the failure");
  },
  deadline: expectDeadline,
  cancel: expectCancel,
  expired: expectExpired,
  at_most_once: async ({ interop }) => {
    const { count: before } = await interop.add({ count: 0 });
    for (let i = 1; i <= 100; i += 1) {
      same((await interop.add({ count: 1 })).count, before + i, "the sum");
    }
  },
  concurrent: async ({ interop }) => {
    const texts = Array.from({ length: 32 }, (_, i) => `text ${i} ${"x".repeat(i * 20)}`);
    const replies = await Promise.all(texts.map((text) => interop.echoValues(Values.of({ text }))));
    same(
      replies.map((one) => one.text),
      texts,
      "the echoes",
    );
  },
  oneways: expectOneways,
  priority: async ({ interop }) => {
    for (const priority of [0, 50]) {
      same((await interop.priority({ priority })).priority, priority, "the priority");
    }
  },
};

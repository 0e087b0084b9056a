// Gives the payloads in a folder back, as decoded and encoded again: exchange_values.js FOLDER.
import assert from "node:assert/strict";
import { readdirSync, readFileSync, writeFileSync } from "node:fs";
import { BadValue, type Codec, tableCodec } from "rtpm/values";
import {
  type Any,
  Axes,
  Happened,
  HappenedEvent,
  Leaf,
  MethodClient,
  MethodInterface,
  MethodMethods,
  type MethodServant,
  methodSkeleton,
  Mode,
  Optionals,
  Packed,
  Ranged,
  Required,
  Scalars,
  Tree,
  Vec,
  Vectors,
} from "./exchange.rtpm.js";

// A payload's type is known by its file's name only.
// eslint-disable-next-line @typescript-eslint/no-explicit-any
const codecs: Record<string, Codec<any>> = {
  Scalars: Scalars.codec,
  Optionals: Optionals.codec,
  Vectors: Vectors.codec,
  Tree: Tree.codec,
  Required: Required.codec,
  Bare: Packed.codec,
  Ranged: Ranged.codec,
  Happened: Happened.codec,
};

function giveBack<T>(codec: Codec<T>, bytes: Uint8Array): Uint8Array {
  const value = codec.decode(bytes);
  const encoded = codec.encode(value);
  // A view that does not begin at a multiple of 8 must do, too.
  const moved = new Uint8Array(encoded.length + 3);
  moved.set(encoded, 3);
  assert.deepEqual(codec.decode(moved.subarray(3)), value);
  return encoded;
}

function checkPacked(packed: Packed): void {
  assert.equal(packed.at, -1);
  assert.equal(packed.bytes, 255);
  assert.equal(packed.value, 4294967295);
  assert.deepEqual(packed.wrap, { x: 1, y: 2, build: 3 });
  assert.deepEqual(packed.modes, Uint8Array.of(Mode.Free, Mode.class, 9));
  assert.deepEqual(packed.vecs[1], { x: 7, y: 8, build: 9 });
  assert.deepEqual(packed.flags, [true, false, true]);
  assert.equal(packed.axes, Axes.Last | Axes.X);
  assert.deepEqual(packed.u16s, Uint16Array.of(1, 65535));
  assert.equal(packed.u64, 18446744073709551615n);
  assert.equal(packed.getClass, -3);
  assert.equal(packed.lab, -4n);
  assert.deepEqual(packed.reals, Float32Array.of(0.5, -0.25));
  assert.equal(packed.isOn, true);
}

function checkFields(): void {
  const absent = Scalars.of();
  assert.deepEqual([absent.a, absent.b, absent.f, absent.m], [-3, 255, 4294967295, Mode.Hold]);
  assert.equal(absent.g, -9223372036854775808n);
  assert.equal(absent.n, Axes.X | Axes.Last);
  assert.equal(absent.h, 18446744073709551615n);
  assert.deepEqual(Scalars.codec.decode(Scalars.codec.encode(absent)), absent);
  const negativeZero = Scalars.of({ j: -0 });
  assert.deepEqual(Scalars.codec.decode(Scalars.codec.encode(negativeZero)), negativeZero);
  assert.equal(Leaf.codec.decode(Leaf.codec.encode(Leaf.of({ then_: 7 }))).then_, 7);
}

function refuses(action: () => unknown): void {
  assert.throws(action, BadValue);
}

/** A message of 150 kB whose 20000 offsets lead to one text of 64 KiB: 1.3 GB when decoded. */
function sharedText(): Uint8Array {
  const texts = new Array<string>(20000).fill("");
  texts[0] = "x".repeat(65536);
  const encoded = Vectors.codec.encode(Vectors.of({ p: texts }));
  const view = new DataView(encoded.buffer);
  const table = view.getUint32(0, true);
  const vtable = table - view.getInt32(table, true);
  const slot = table + view.getUint16(vtable + 4 + 2 * 14, true);
  const first = slot + view.getUint32(slot, true) + 4;
  const text = first + view.getUint32(first, true);
  for (let at = first; at < first + 4 * texts.length; at += 4) view.setUint32(at, text - at, true);
  return encoded;
}

function checkRefusals(): void {
  const encode = (fields: Partial<Scalars>): Uint8Array => Scalars.codec.encode(Scalars.of(fields));
  refuses(() => encode({ a: 128 }));
  refuses(() => encode({ b: -1 }));
  refuses(() => encode({ b: 0.5 }));
  refuses(() => encode({ f: 4294967296 }));
  refuses(() => encode({ h: 18446744073709551616n }));
  refuses(() => encode({ i: "1" as unknown as number }));
  refuses(() => Tree.codec.encode(Tree.of({} as { name: string })));
  refuses(() => Tree.codec.encode(Tree.of({ name: "\ud800" })));
  const unknown: Any = { type: "unknown", number: 9 };
  refuses(() => Tree.codec.encode(Tree.of({ name: "", any: unknown })));
  let tree = Tree.of({ name: "leaf" });
  for (let i = 0; i < 70; ++i) tree = Tree.of({ name: "branch", left: tree });
  refuses(() => Tree.codec.encode(tree));
  const deep = tableCodec("deep", 99, Tree.codec.read, Tree.codec.write).encode(tree);
  refuses(() => Tree.codec.decode(deep));
  const crooked = encode({ e: 5 });
  const view = new DataView(crooked.buffer);
  const entry = 4 - view.getInt32(4, true) + 4 + 2 * 4;
  assert.equal(view.getUint32(0, true), 4);
  view.setUint16(entry, view.getUint16(entry, true) + 1, true);
  refuses(() => Scalars.codec.decode(crooked));
  refuses(() => Vec.codec.decode(new Uint8Array(23)));
  refuses(() => Vectors.codec.decode(sharedText()));
  refuses(() => Tree.codec.decode(new Uint8Array(0)));
}

function checkTexts(): void {
  const good = Tree.codec.encode(Tree.of({ name: "ab" }));
  const name = good.length - 7;
  assert.deepEqual([...good.subarray(name)], [2, 0, 0, 0, 0x61, 0x62, 0]);
  for (const wrong of [[0xc3, 0x78, 0], [0xff, 0x78, 0], [0x61, 0x62, 0x63]]) {
    const bytes = good.slice();
    bytes.set(wrong, name + 4);
    refuses(() => Tree.codec.decode(bytes));
  }
  refuses(() => Tree.codec.decode(Leaf.codec.encode(Leaf.of())));
}

/** Does not run: the compiler must refuse each of these. */
export function mistakes(client: MethodClient): unknown[] {
  return [
    // @ts-expect-error 64 bits are a bigint.
    Scalars.of({ h: 1 }),
    // @ts-expect-error The name is required.
    Tree.of({}),
    // @ts-expect-error Doubles are a Float64Array.
    Vectors.of({ j: Float32Array.of(1) }),
    // @ts-expect-error The union has no such member.
    Tree.of({ name: "", any: { type: "Sphere", value: Leaf.of() } }),
    // @ts-expect-error The request is a Tree.
    client.wait(Leaf.of()),
    // @ts-expect-error A struct has all its fields.
    Vec.codec.encode({ x: 1, y: 2 }),
  ];
}

function checkRanges(): void {
  const request = MethodMethods.constructor_.request;
  request.decode(request.encode(Ranged.of({ b: 10000000000000000000n })));
  for (const bad of [
    Ranged.of({ a: Uint8Array.of(201) }),
    Ranged.of({ b: 18446744073709551615n }),
    Ranged.of({ c: 2 }),
    Ranged.of({ e: NaN }),
    Ranged.of({ tree: [Ranged.of({ e: 3 })] }),
    Ranged.of({ any: { type: "Ranged", value: Ranged.of({ c: -2 }) } }),
  ]) {
    const bytes = request.encode(bad);
    refuses(() => request.decode(bytes));
    assert.deepEqual(Ranged.codec.decode(bytes), bad);
  }
}

// Compiles: each method has the type that its schema says.
const servant: MethodServant = {
  wait: (request) => request,
  toString_: () => undefined,
  delete: async function* () {
    yield Leaf.of();
  },
  constructor_: (request) => Promise.resolve(request),
  interface: () => undefined,
  skeleton: () => undefined,
  caller: () => Vectors.of(),
  __proto_: () => undefined,
  exchange: () => Optionals.of(),
};

function checkMethods(): void {
  assert.equal(MethodMethods.caller.deadlineMs, 1.5);
  assert.equal(MethodMethods.interface.kind, "oneway");
  assert.equal(MethodMethods.skeleton.kind, "receipt");
  assert.equal(MethodInterface.name, "lab.native.Method");
  assert.match(MethodInterface.text ?? "", /^service lab\.native\.Method\n/);
  assert.ok(MethodInterface.schema?.includes("\\u0041, */ the end"));
  assert.ok(MethodInterface.schema?.includes("`tick`, ${x}, 25 °C"));
  assert.equal(HappenedEvent.type, 77);
  assert.equal(HappenedEvent.fields.length, 5);
  assert.equal(methodSkeleton(servant).operations.get(3)?.method, MethodMethods.delete);
}

/** Numbers that look random, and are the same in each run. */
function makeRandom(seed: number): (below: number) => number {
  let state = seed;
  return (below) => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return Math.floor((state / 4294967296) * below);
  };
}

function spoil(bytes: Uint8Array, random: (below: number) => number): Uint8Array {
  const spoiled = new Uint8Array(random(8) === 0 ? random(bytes.length + 9) : bytes.length);
  spoiled.set(bytes.subarray(0, spoiled.length));
  for (let i = random(4); i >= 0 && spoiled.length > 4; --i) {
    const at = random(spoiled.length - 3);
    const from = random(spoiled.length - 3);
    const choice = random(4);
    if (choice === 0) spoiled[at] = random(256);
    if (choice === 1) spoiled[at] = (spoiled[at] ?? 0) ^ (1 << random(8));
    if (choice === 2) spoiled.set([random(256), random(256), random(256), random(256)], at & ~3);
    if (choice === 3) spoiled.copyWithin(at, from, from + 4);
  }
  return spoiled;
}

function hostile<T>(codec: Codec<T>, bytes: Uint8Array): void {
  let value: T;
  try {
    value = codec.decode(bytes);
  } catch (error) {
    assert.ok(error instanceof BadValue, String(error));
    return;
  }
  try {
    codec.encode(value);
  } catch (error) {
    assert.match(String(error), /BadValue: .*unknown/);
  }
}

const folder = process.argv[2] ?? ".";
const files = readdirSync(folder).filter((name) => name.endsWith(".cpp"));
const payloads = files.map((name) => {
  const codec = codecs[name.split(".")[1] ?? ""];
  assert.ok(codec, name);
  return { name, codec, bytes: new Uint8Array(readFileSync(`${folder}/${name}`)) };
});
assert.ok(payloads.length > 15);
for (const { name, codec, bytes } of payloads) {
  writeFileSync(`${folder}/${name.replace(/cpp$/, "ts")}`, giveBack(codec, bytes));
  if (name.includes(".Bare.")) checkPacked(Packed.codec.decode(bytes));
}
checkFields();
checkRefusals();
checkTexts();
checkRanges();
checkMethods();
const random = makeRandom(46);
const end = Date.now() + 1000;
let count = 0;
for (; Date.now() < end; ++count) {
  const payload = payloads[random(payloads.length)];
  if (payload !== undefined) hostile(payload.codec, spoil(payload.bytes, random));
}
console.log(`${payloads.length} payloads, ${count} hostile ones`);

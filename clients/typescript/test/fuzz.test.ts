import assert from "node:assert/strict";
import { existsSync, readFileSync, readdirSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";
import fc from "fast-check";
import { DeviceMethods } from "../idl/device.rtpm.js";
import { HubInterface, HubMethods } from "../idl/events.rtpm.js";
import { InteropMethods } from "../idl/tests/interop.rtpm.js";
import { FrameReader } from "../src/client/frame_reader.js";
import { concat, toHex, utf8 } from "../src/core/bytes.js";
import * as control from "../src/core/control.js";
import { readDiscovery } from "../src/core/discovery.js";
import { readHello, readWelcome, writeHello } from "../src/core/handshake.js";
import { readHeader, writeHeader } from "../src/core/header.js";
import { findObstacle } from "../src/core/interface_text.js";
import { headerSize } from "../src/core/numbers.js";
import { parseUrl, urlText } from "../src/core/url.js";
import { readEvents } from "../src/events/event.js";
import { parseKey } from "../src/sealed/client.js";
import { BadValue, type AnyMethod } from "../src/index.js";
import { FuzzedPair } from "./support/fuzzed_pair.js";
import { Script } from "./support/script.js";
import { specFolder } from "./support/vectors.js";

// Random bytes and those of tests/fuzz/corpus. RTPM_FUZZ_SECONDS says how long, in all; a failure
// prints the seed and the shortest input that fails.

const propertyCount = 7;
const seconds = Number(process.env["RTPM_FUZZ_SECONDS"] ?? 4);

const corpusFolder = join(specFolder, "..", "tests", "fuzz", "corpus");
function corpusOf(...names: string[]): Uint8Array[] {
  const folders = names.map((name) => join(corpusFolder, name)).filter(existsSync);
  return folders.flatMap((folder) =>
    readdirSync(folder).map((file) => new Uint8Array(readFileSync(join(folder, file)))),
  );
}

/** A part of the corpus, of which some bytes are others. */
function mutated(corpus: readonly Uint8Array[]): fc.Arbitrary<Uint8Array> {
  const change = fc.record({ at: fc.nat(), byte: fc.integer({ min: 0, max: 255 }) });
  return fc
    .record({
      bytes: fc.constantFrom(...corpus),
      changes: fc.array(change, { maxLength: 8 }),
      size: fc.nat(),
      tail: fc.uint8Array({ maxLength: 64 }),
    })
    .map(({ bytes, changes, size, tail }) => {
      const end = size % 4 === 0 ? size % (bytes.length + 1) : bytes.length;
      const result = concat(bytes.slice(0, end), tail);
      for (const { at, byte } of changes) {
        if (result.length > 0) result[at % result.length] = byte;
      }
      return result;
    });
}

function input(sizeMax: number, ...names: string[]): fc.Arbitrary<Uint8Array> {
  const random = fc.uint8Array({ maxLength: sizeMax, size: "max" });
  const corpus = corpusOf(...names);
  return corpus.length === 0 ? random : fc.oneof(random, mutated(corpus));
}

/** Runs what every input must stand, the corpus first. */
function fuzz(arbitrary: fc.Arbitrary<Uint8Array>, run: (bytes: Uint8Array) => void): void {
  fc.assert(fc.property(arbitrary, run), {
    numRuns: Number.MAX_SAFE_INTEGER,
    interruptAfterTimeLimit: (seconds * 1000) / propertyCount,
    markInterruptAsFailure: false,
    includeErrorInReport: true,
  });
}

test("payloads and texts are read or refused, and written as they were read", () => {
  const readers: ((bytes: Uint8Array) => unknown)[] = [
    readWelcome,
    readDiscovery,
    control.readBindRequest,
    control.readBindReply,
    control.readDescribeRequest,
    readEvents,
  ];
  fuzz(input(200, "frame", "reassembly"), (bytes) => {
    const header = readHeader(bytes);
    if (typeof header !== "string") {
      const again = new Uint8Array(headerSize);
      writeHeader(header, again);
      assert.equal(toHex(again), toHex(bytes.subarray(0, headerSize)));
    }
    for (const read of readers) read(bytes);
    const hello = readHello(bytes);
    if (hello !== undefined) assert.equal(toHex(writeHello(hello)), toHex(bytes));
    const ack = control.readAck(bytes);
    if (ack !== undefined) assert.equal(toHex(control.writeAck(ack)), toHex(bytes));
    const credit = control.readCredit(bytes);
    if (credit !== undefined) assert.equal(toHex(control.writeCredit(credit)), toHex(bytes));
    const text = utf8.decode(bytes);
    parseKey(text);
    const url = parseUrl(`rtpm://${text}`);
    if (url !== undefined) assert.deepEqual(parseUrl(urlText(url)), url);
  });
});

test("frames are cut from a stream alike, however it comes in parts", () => {
  fuzz(input(400, "frame", "server", "client"), (bytes) => {
    const cut = (size: number): string[] => {
      const reader = new FrameReader(true);
      const frames: string[] = [];
      for (let at = 0; at < bytes.length; at += size) {
        const fault = reader.read(bytes.subarray(at, at + size), (frame) => {
          frames.push(toHex(frame));
          return true;
        });
        if (fault !== undefined) return [...frames, fault];
      }
      return frames;
    };
    assert.deepEqual(cut(1), cut(bytes.length));
    assert.deepEqual(cut(7), cut(bytes.length));
  });
});

test("values are decoded or refused, and encode to what decodes to the same", () => {
  const methods: AnyMethod[] = [DeviceMethods, HubMethods, InteropMethods].flatMap(
    (list) => Object.values(list) as AnyMethod[],
  );
  const codecs = methods.flatMap((method) => [method.request, method.reply]);
  fuzz(input(600, "frame", "filter", "schema"), (bytes) => {
    // The first byte chooses; a FlatBuffer begins behind it.
    const codec = codecs[(bytes[0] ?? 0) % codecs.length]!;
    let value: unknown;
    try {
      value = codec.decode(bytes.slice(1)) as unknown;
    } catch (error) {
      assert.ok(error instanceof BadValue, String(error));
      return;
    }
    assert.deepEqual(codec.decode(codec.encode(value)), value);
  });
});

test("values with a few wrong bytes", () => {
  const bytes = [
    InteropMethods.echoValues.request.encode({
      text: "naïve 🖐",
      absent: "there",
      texts: ["", "a"],
      reals: Float64Array.of(1, NaN),
      bytes: Uint8Array.of(1, 2, 3),
      longs: BigUint64Array.of(1n),
      vectors: [{ x: 1, y: 2, z: 3 }],
      leaves: [{ name: "leaf", weight: 1 }],
      colors: Uint8Array.of(7),
      shape: { type: "Leaf", value: { name: "b", weight: undefined } },
      color: 2,
      level: 9,
      maybe: 5n,
      newton: 1,
    }),
  ];
  let good = 0;
  fuzz(mutated(bytes), (changed) => {
    try {
      InteropMethods.echoValues.reply.decode(changed);
      good += 1;
    } catch (error) {
      assert.ok(error instanceof BadValue, String(error));
    }
  });
  assert.ok(good > 0);
});

test("texts of interfaces", () => {
  const own = HubInterface.text ?? "";
  fuzz(mutated([utf8.encode(own)]), (bytes) => {
    findObstacle(own, utf8.decode(bytes));
    findObstacle(utf8.decode(bytes), own);
  });
});

for (const isSealed of [false, true]) {
  test(`client and server with a hostile network${isSealed ? ", sealed" : ""}`, () => {
    let replies = 0;
    fuzz(input(400, "conversation", "server", "client", "sealed"), (bytes) => {
      const pair = new FuzzedPair((bytes[0] ?? 0) % 2 === 0 ? "datagram" : "stream", isSealed);
      pair.run(new Script(bytes.subarray(1)));
      replies += pair.replyCount;
    });
    assert.ok(replies > 0, `${replies} calls got a reply`);
  });
}

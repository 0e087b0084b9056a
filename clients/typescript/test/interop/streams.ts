import assert from "node:assert/strict";
import { setTimeout as sleep } from "node:timers/promises";
import { Range } from "../../idl/tests/interop.rtpm.js";
import { CallError } from "../../src/index.js";
import { same, until, type Case } from "./check.js";

export const streamCases: Record<string, Case> = {
  stream: async ({ interop }) => {
    let next = 0;
    for await (const { number } of interop.countUp(Range.of({ count: 2000 }))) {
      same(number, next, "the item");
      next += 1;
    }
    same(next, 2000, "the number of items");
  },
  slow_reader: async ({ interop }) => {
    let next = 0;
    for await (const item of interop.countUp(Range.of({ count: 3000, padding: 1000 }))) {
      same([item.number, item.padding.length], [next, 1000], "the item");
      next += 1;
      if (next <= 5) await sleep(100);
    }
    same(next, 3000, "the number of items");
  },
  stream_cancel: async ({ interop, options }) => {
    for await (const { number } of interop.countUp(Range.of())) {
      if (number === 5) break;
    }
    const hasEnded = async (): Promise<boolean> => (await interop.streams()).count === 0;
    const isOver = await until(hasEnded, options.isLossy ? 0 : 2000);
    // A CANCEL that is lost has no effect but later.
    assert.ok(isOver || options.isLossy, "the stream still runs after 2 s");
  },
  stream_failure: async ({ interop }) => {
    const seen: number[] = [];
    try {
      const items = interop.countUp(Range.of({ count: 3, failure: "größer als 5" }));
      for await (const { number } of items) seen.push(number);
      assert.fail("the stream ended without a failure");
    } catch (error) {
      assert.ok(error instanceof CallError, String(error));
      same(error.code, "servant_failed", "the status");
    }
    same(seen, [0, 1, 2], "the items before");
  },
};

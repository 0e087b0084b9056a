import { existsSync, readFileSync, readdirSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import type { FrameCounters } from "../../src/core/counters.js";

function findSpec(): string {
  if (process.env["RTPM_SPEC"] !== undefined) return process.env["RTPM_SPEC"];
  for (let folder = dirname(fileURLToPath(import.meta.url)); ; folder = dirname(folder)) {
    if (existsSync(join(folder, "spec", "vectors"))) return join(folder, "spec");
    if (folder === dirname(folder)) throw new Error("spec/vectors is in no folder above this one");
  }
}

export const specFolder = findSpec();

// The files are ours and are tested where they are made, so their types are taken on trust.
// eslint-disable-next-line @typescript-eslint/no-explicit-any
export type Json = any;

export function readVectors(name: string): Json {
  return JSON.parse(readFileSync(join(specFolder, "vectors", name), "utf8"));
}

export function conversationNames(): string[] {
  return readdirSync(join(specFolder, "vectors", "conversations"))
    .map((name) => name.replace(/\.json$/, ""))
    .sort();
}

/** Remembers how often frames were dropped, to tell what was dropped since. */
export class DropWatch {
  private before = new Map<string, number>();

  constructor(private readonly counters: FrameCounters) {}

  /** The reasons of the frames that were dropped since the last call. */
  since(): string[] {
    const reasons: string[] = [];
    for (const [reason, count] of this.counters.dropped) {
      for (let i = this.before.get(reason) ?? 0; i < count; i += 1) reasons.push(reason);
    }
    this.before = new Map(this.counters.dropped);
    return reasons;
  }
}

/** Not random: the tests are the same in each run. */
export function fixedRandom(): (bytes: Uint8Array) => Uint8Array {
  let state = 1;
  return (bytes) => {
    for (let i = 0; i < bytes.length; i += 1) {
      state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
      bytes[i] = state >>> 24;
    }
    return bytes;
  };
}

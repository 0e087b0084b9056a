import assert from "node:assert/strict";
import { fromHex } from "../../src/core/bytes.js";
import type { Json } from "./vectors.js";

function littleEndian(hex: string): number {
  return Number([...fromHex(hex)].reduceRight((sum, byte) => sum * 256n + BigInt(byte), 0n));
}

/** A name without its number: choices of one kind differ from each other. */
function kindOf(name: string): string {
  return name.replace(/[0-9]+$/, "");
}

/**
 * The bytes that one side is free to choose, `<name>` in a vector's hex: those of the tested side
 * are learned from the first frame that has them, those of the other side are the examples.
 */
export class FreeBytes {
  private readonly size = new Map<string, number>();
  private readonly known = new Map<string, string>();

  constructor(free: Json, role: "client" | "server") {
    for (const [name, choice] of Object.entries<Json>(free ?? {})) {
      this.size.set(name, choice.size);
      if (choice.chosen_by !== role) this.known.set(name, choice.example);
    }
  }

  /** The hex of a frame that is given to the tested side. */
  fillIn(pattern: string): string {
    return pattern.replace(/<([^>]+)>/g, (_, name: string) => this.hexOf(name));
  }
  /** A number, written as itself or as `<name>`. */
  number(value: number | string): number {
    return typeof value === "number" ? value : littleEndian(this.fillIn(value));
  }

  /** Whether a frame of the tested side is as in the pattern; learns names at their first use. */
  matches(pattern: string, hex: string): boolean {
    const learned = new Map<string, string>();
    let at = 0;
    for (const part of pattern.split(/(<[^>]+>)/)) {
      const name = part.startsWith("<") ? part.slice(1, -1) : undefined;
      const size = name === undefined ? part.length : 2 * (this.size.get(name) ?? 0);
      const here = hex.slice(at, at + size);
      at += size;
      const wanted =
        name === undefined ? part : (this.known.get(name) ?? learned.get(name) ?? here);
      if (here !== wanted || here.length !== size) return false;
      if (name !== undefined) learned.set(name, here);
    }
    if (at !== hex.length) return false;
    for (const [name, value] of learned) this.learn(name, value);
    return true;
  }

  private hexOf(name: string): string {
    const hex = this.known.get(name);
    assert.ok(hex !== undefined, `<${name}> is used before it was sent`);
    return hex;
  }

  private learn(name: string, value: string): void {
    if (this.known.get(name) === value) return;
    for (const [other, otherValue] of this.known) {
      if (kindOf(other) !== kindOf(name) || kindOf(name) === "cookie") continue;
      assert.notEqual(value, otherValue, `<${name}> is the same as <${other}>`);
      if (kindOf(name) !== "call") continue;
      const step = (littleEndian(value) - littleEndian(otherValue)) >>> 0;
      assert.ok(step < 2 ** 31, `<${name}> is not later than <${other}>`);
    }
    this.known.set(name, value);
  }
}

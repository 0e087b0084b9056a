import { concat, viewOf } from "../core/bytes.js";
import { headerSize } from "../core/numbers.js";
import { nonceOf, tagSize, type Algorithms, type Suite } from "./algorithms.js";
import { trailerSize } from "./frames.js";

const windowSize = 1024;
const generationSize = 2 ** 22;
const counterEnd = 2 ** 48;
const forgedMax = 2 ** 36;
const rekeyCounter = 0xffff_ffff_ffff_ffffn;

/** The key of the next generation (sec-5-5). */
export function nextKey(algorithms: Algorithms, suite: Suite, key: Uint8Array): Uint8Array {
  const nonce = nonceOf(suite, rekeyCounter);
  const sealed = algorithms.seal(suite, key, nonce, new Uint8Array(0), new Uint8Array(32));
  return sealed.slice(0, 32);
}

/** The keys of one direction around its current generation. */
class Keys {
  private readonly keys = new Map<number, Uint8Array>();

  constructor(
    private readonly algorithms: Algorithms,
    private readonly suite: Suite,
    key: Uint8Array,
  ) {
    this.keys.set(0, key);
  }
  at(generation: number): Uint8Array | undefined {
    const before = this.keys.get(generation - 1);
    if (!this.keys.has(generation) && before !== undefined) {
      this.keys.set(generation, nextKey(this.algorithms, this.suite, before));
    }
    return this.keys.get(generation);
  }
  /** Forgets the keys before the one before this generation. */
  moveTo(generation: number): void {
    for (const key of this.keys.keys()) if (key < generation - 1) this.keys.delete(key);
  }
}

/** Seals the frames of one session in one direction, and opens those of the other (sec-5). */
export class SealedSession {
  hasEnded = false;
  private sendCounter = 0;
  private readonly sendKeys: Keys;
  private readonly receiveKeys: Keys;
  private largest = -1;
  private readonly seen = new Float64Array(windowSize).fill(-1);
  private forgedCount = 0;

  /** @param isExact  over a stream each counter is the one after the last (sec-5-7) */
  constructor(
    private readonly algorithms: Algorithms,
    private readonly suite: Suite,
    keys: { readonly send: Uint8Array; readonly receive: Uint8Array },
    private readonly isExact: boolean,
  ) {
    this.sendKeys = new Keys(algorithms, suite, keys.send);
    this.receiveKeys = new Keys(algorithms, suite, keys.receive);
  }

  /**
   * The sealed frame of a header, with its flag, and a payload; undefined once the session ended.
   * Each call uses a counter up (sec-5-1).
   */
  seal(header: Uint8Array, payload: Uint8Array): Uint8Array | undefined {
    const counter = this.sendCounter;
    if (counter >= counterEnd) this.hasEnded = true; // sec-5-6
    if (this.hasEnded) return undefined;
    this.sendCounter += 1;
    const generation = Math.floor(counter / generationSize);
    const key = this.sendKeys.at(generation)!;
    this.sendKeys.moveTo(generation);
    const nonce = nonceOf(this.suite, BigInt(counter));
    const sealed = this.algorithms.seal(this.suite, key, nonce, header, payload);
    const counterBytes = new Uint8Array(8);
    viewOf(counterBytes).setBigUint64(0, BigInt(counter), true);
    const end = sealed.length - tagSize;
    return concat(header, sealed.subarray(0, end), counterBytes, sealed.subarray(end));
  }

  /** The payload of a sealed frame; the reason for which it is dropped, which changes nothing. */
  open(frame: Uint8Array): Uint8Array | "replayed" | "bad_seal" {
    const at = frame.length - trailerSize;
    if (this.hasEnded || at < headerSize) return "bad_seal";
    const wide = viewOf(frame).getBigUint64(at, true);
    if (wide >= BigInt(counterEnd)) return "bad_seal";
    const counter = Number(wide);
    if (this.isExact ? counter !== this.largest + 1 : !this.isNew(counter)) return "replayed";
    const current = Math.max(Math.floor(this.largest / generationSize), 0);
    const generation = Math.floor(counter / generationSize);
    if (Math.abs(generation - current) > 1) return "bad_seal"; // sec-5-5
    const key = this.receiveKeys.at(generation);
    if (key === undefined) return "bad_seal";
    const sealed = concat(frame.subarray(headerSize, at), frame.subarray(at + 8));
    const nonce = nonceOf(this.suite, wide);
    const header = frame.subarray(0, headerSize);
    const payload = this.algorithms.open(this.suite, key, nonce, header, sealed);
    if (payload === undefined) {
      this.forgedCount += 1;
      this.hasEnded = this.forgedCount >= forgedMax; // sec-5-6
      return "bad_seal";
    }
    this.largest = Math.max(this.largest, counter);
    this.seen[counter % windowSize] = counter;
    this.receiveKeys.moveTo(Math.floor(this.largest / generationSize));
    return payload;
  }

  // sec-5-4
  private isNew(counter: number): boolean {
    if (counter > this.largest) return true;
    return this.largest - counter < windowSize && this.seen[counter % windowSize] !== counter;
  }
}

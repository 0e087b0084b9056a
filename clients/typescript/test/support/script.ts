import { viewOf } from "../../src/core/bytes.js";

/** A fuzzer's input, read as numbers; behind its end all are 0. */
export class Script {
  private at = 0;
  constructor(private readonly input: Uint8Array) {}

  get hasMore(): boolean {
    return this.at < this.input.length;
  }
  byte(): number {
    return this.input[this.at++] ?? 0;
  }
  /** Below `end`. */
  below(end: number): number {
    return end <= 0 ? 0 : this.byte() % end;
  }
  number(): number {
    const bytes = Uint8Array.of(this.byte(), this.byte(), this.byte(), this.byte());
    return viewOf(bytes).getUint32(0, true);
  }
  bytes(size: number): Uint8Array {
    return Uint8Array.from({ length: size }, () => this.byte());
  }
}

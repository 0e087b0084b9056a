import { BadValue } from "./codec.js";
import type { StructCodec, TableCodec, UnionCodec } from "./codecs.js";
import { type Numbers, writeNumbers } from "./numbers.js";
import * as scalars from "./scalars.js";

const sizeMax = 1 << 30;
const vtableMemory = 32;
const utf8 = new TextEncoder();
const halfSurrogate = /\p{Surrogate}/u;

/**
 * Builds one FlatBuffer for generated code, front to back: a table, its vtable, then what its
 * offsets lead to. Between `open` and `close` come the table's fields; the methods with the
 * position of an offset come behind it, and do nothing where that is 0.
 */
export class TableWriter {
  #bytes = new Uint8Array(256);
  #view = new DataView(this.#bytes.buffer);
  #end = 4;
  #depthLeft: number;
  #table = 0;
  #slots: number[] = [];
  readonly #vtables: number[] = [];

  constructor(depthMax: number) {
    this.#depthLeft = depthMax;
  }

  /** The finished message, whose root the offset at 0 leads to. */
  finish(): Uint8Array {
    return this.#bytes.slice(0, this.#end);
  }

  /** Writes the root. */
  root<T>(codec: TableCodec<T>, value: T): void {
    this.#point(0, 4, 0);
    codec.write(this, value);
  }

  /** Begins a table with so many slots. */
  open(slotCount: number): void {
    if (--this.#depthLeft < 0) throw new BadValue("its tables nest too deep");
    this.#slots = new Array<number>(slotCount).fill(0);
    this.#table = this.#reserve(4, 4);
  }

  /** Ends the table's fields; the targets of its offsets follow, then `leave`. */
  close(): void {
    const tableSize = this.#end - this.#table;
    if (tableSize > 0xffff) throw new BadValue("a table's fields are larger than 65535 bytes");
    while (this.#slots.at(-1) === 0) this.#slots.pop();
    const vtableSize = 4 + 2 * this.#slots.length;
    const vtable = this.#reserve(vtableSize, 2);
    this.#view.setUint16(vtable, vtableSize, true);
    this.#view.setUint16(vtable + 2, tableSize, true);
    this.#slots.forEach((at, i) => {
      this.#view.setUint16(vtable + 4 + 2 * i, at === 0 ? 0 : at - this.#table, true);
    });
    this.#view.setInt32(this.#table, this.#table - this.#shared(vtable), true);
  }

  /** Ends a table with all that its offsets lead to. */
  leave(): void {
    ++this.#depthLeft;
  }

  /** Adds a number, unless it is what stands for an absent one. */
  bool(slot: number, value: boolean | undefined, absent: boolean | undefined): void {
    if (value === absent || value === undefined) return;
    const at = this.#inline(slot, 1, 1);
    this.#view.setUint8(at, value ? 1 : 0);
  }
  int8(slot: number, value: number | undefined, absent: number | undefined): void {
    if (value === absent || value === undefined) return;
    const at = this.#inline(slot, 1, 1);
    this.#view.setInt8(at, scalars.int8(value));
  }
  uint8(slot: number, value: number | undefined, absent: number | undefined): void {
    if (value === absent || value === undefined) return;
    const at = this.#inline(slot, 1, 1);
    this.#view.setUint8(at, scalars.uint8(value));
  }
  int16(slot: number, value: number | undefined, absent: number | undefined): void {
    if (value === absent || value === undefined) return;
    const at = this.#inline(slot, 2, 2);
    this.#view.setInt16(at, scalars.int16(value), true);
  }
  uint16(slot: number, value: number | undefined, absent: number | undefined): void {
    if (value === absent || value === undefined) return;
    const at = this.#inline(slot, 2, 2);
    this.#view.setUint16(at, scalars.uint16(value), true);
  }
  int32(slot: number, value: number | undefined, absent: number | undefined): void {
    if (value === absent || value === undefined) return;
    const at = this.#inline(slot, 4, 4);
    this.#view.setInt32(at, scalars.int32(value), true);
  }
  uint32(slot: number, value: number | undefined, absent: number | undefined): void {
    if (value === absent || value === undefined) return;
    const at = this.#inline(slot, 4, 4);
    this.#view.setUint32(at, scalars.uint32(value), true);
  }
  int64(slot: number, value: bigint | undefined, absent: bigint | undefined): void {
    if (value === absent || value === undefined) return;
    const at = this.#inline(slot, 8, 8);
    this.#view.setBigInt64(at, scalars.int64(value), true);
  }
  uint64(slot: number, value: bigint | undefined, absent: bigint | undefined): void {
    if (value === absent || value === undefined) return;
    const at = this.#inline(slot, 8, 8);
    this.#view.setBigUint64(at, scalars.uint64(value), true);
  }
  float32(slot: number, value: number | undefined, absent: number | undefined): void {
    if (Object.is(value, absent) || value === undefined) return;
    const at = this.#inline(slot, 4, 4);
    this.#view.setFloat32(at, scalars.real(value), true);
  }
  float64(slot: number, value: number | undefined, absent: number | undefined): void {
    if (Object.is(value, absent) || value === undefined) return;
    const at = this.#inline(slot, 8, 8);
    this.#view.setFloat64(at, scalars.real(value), true);
  }

  /** Adds a struct, unless it is undefined. */
  struct<T>(slot: number, codec: StructCodec<T>, value: T | undefined): void {
    if (value === undefined) return;
    const at = this.#inline(slot, codec.size, codec.alignment);
    codec.write(this.#view, at, value);
  }
  requiredStruct<T>(slot: number, name: string, codec: StructCodec<T>, value: T): void {
    if (value === undefined) throw new BadValue(`${name} is undefined, but required`);
    this.struct(slot, codec, value);
  }

  /** Adds an offset, if something is there for it. @returns its position, else 0 */
  reference(slot: number, isPresent: boolean): number {
    return isPresent ? this.#inline(slot, 4, 4) : 0;
  }

  /** Adds a required offset. @returns its position @throws BadValue if the value is undefined */
  required(slot: number, name: string, value: unknown): number {
    if (value === undefined) throw new BadValue(`${name} is undefined, but required`);
    return this.#inline(slot, 4, 4);
  }

  /** Writes a text that the offset at a position leads to. */
  string(reference: number, value: string): void {
    if (reference === 0) return;
    if (halfSurrogate.test(value)) {
      throw new BadValue("a text has half a surrogate pair, which UTF-8 cannot express");
    }
    const content = utf8.encode(value);
    const at = this.#vector(reference, content.length, 1, 1, 1);
    this.#bytes.set(content, at);
  }

  table<T>(reference: number, codec: TableCodec<T>, value: T | undefined): void {
    if (reference === 0 || value === undefined) return;
    this.#point(reference, 4, 0);
    codec.write(this, value);
  }

  /** Writes the struct of a union. */
  structAt<T>(reference: number, codec: StructCodec<T>, value: T): void {
    this.#point(reference, codec.alignment, 0);
    const at = this.#reserve(codec.size, codec.alignment);
    codec.write(this.#view, at, value);
  }

  union<T>(reference: number, codec: UnionCodec<T>, value: T | undefined): void {
    if (reference !== 0 && value !== undefined) codec.write(this, reference, value);
  }

  numbers(reference: number, values: Numbers): void {
    if (reference === 0) return;
    const size = values.BYTES_PER_ELEMENT;
    const at = this.#vector(reference, values.length, size, size, 0);
    writeNumbers(this.#view, at, values);
  }

  bools(reference: number, values: readonly boolean[]): void {
    if (reference !== 0) this.numbers(reference, Uint8Array.from(values, (one) => (one ? 1 : 0)));
  }

  strings(reference: number, values: readonly string[]): void {
    this.#list(reference, values, (at, value) => {
      this.string(at, value);
    });
  }

  tables<T>(reference: number, codec: TableCodec<T>, values: readonly T[]): void {
    this.#list(reference, values, (at, value) => {
      this.#point(at, 4, 0);
      codec.write(this, value);
    });
  }

  structs<T>(reference: number, codec: StructCodec<T>, values: readonly T[]): void {
    if (reference === 0) return;
    const at = this.#vector(reference, values.length, codec.size, codec.alignment, 0);
    values.forEach((value, i) => {
      codec.write(this.#view, at + i * codec.size, value);
    });
  }

  /** `types` is the offset of the vector of the types. */
  unions<T>(types: number, reference: number, codec: UnionCodec<T>, values: readonly T[]): void {
    if (reference === 0) return;
    this.numbers(
      types,
      Uint8Array.from(values, (value) => codec.typeOf(value)),
    );
    this.#list(reference, values, (at, value) => {
      codec.write(this, at, value);
    });
  }

  #list<T>(reference: number, values: readonly T[], write: (at: number, value: T) => void): void {
    if (reference === 0) return;
    const at = this.#vector(reference, values.length, 4, 4, 0);
    values.forEach((value, i) => {
      write(at + 4 * i, value);
    });
  }

  /** The position of a new field. The buffer may be another one after it. */
  #inline(slot: number, size: number, alignment: number): number {
    const at = this.#reserve(size, alignment);
    this.#slots[slot] = at;
    return at;
  }

  /** The position of so many new zeros. */
  #reserve(byteCount: number, alignment: number): number {
    this.#align(alignment, 0);
    if (byteCount > sizeMax - this.#end) throw new BadValue(`it is larger than ${sizeMax} bytes`);
    const at = this.#end;
    this.#end += byteCount;
    if (this.#end > this.#bytes.length) {
      const larger = new Uint8Array(Math.max(this.#end, 2 * this.#bytes.length));
      larger.set(this.#bytes);
      this.#bytes = larger;
      this.#view = new DataView(larger.buffer);
    }
    return at;
  }

  /** Moves the end to where `lead` bytes more are aligned. */
  #align(alignment: number, lead: number): void {
    const rest = (this.#end + lead) % alignment;
    if (rest !== 0) this.#end += alignment - rest;
  }

  /** Lets the offset at a position lead to the end. */
  #point(reference: number, alignment: number, lead: number): void {
    this.#align(alignment, lead);
    this.#view.setUint32(reference, this.#end - reference, true);
  }

  /** Begins a vector. @returns the position of its elements */
  #vector(
    reference: number,
    count: number,
    size: number,
    alignment: number,
    extra: number,
  ): number {
    this.#point(reference, Math.max(alignment, 4), 4);
    const at = this.#reserve(4 + count * size + extra, 1);
    this.#view.setUint32(at, count, true);
    return at + 4;
  }

  /** An equal vtable from before, which then replaces the new one at the end. */
  #shared(vtable: number): number {
    const size = this.#end - vtable;
    const isEqual = (other: number): boolean => {
      for (let i = 0; i < size; ++i) {
        if (this.#bytes[other + i] !== this.#bytes[vtable + i]) return false;
      }
      return true;
    };
    // The first bytes of a vtable are its size.
    const other = this.#vtables.find(isEqual);
    if (other !== undefined) {
      this.#bytes.fill(0, vtable, this.#end);
      this.#end = vtable;
      return other;
    }
    if (this.#vtables.length < vtableMemory) this.#vtables.push(vtable);
    return vtable;
  }
}

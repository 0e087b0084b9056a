import { BadValue } from "./codec.js";
import { type Numbers, type NumbersType, readNumbers } from "./numbers.js";
import type { StructCodec, TableCodec, UnionCodec } from "./codecs.js";

// Offsets may point to the same bytes more than once. Without a limit, a small message could become
// values without bound.
const sharingMax = 64;
const sharedBytesMax = 64 * 1024 * 1024;

// A byte order mark is a part of the text.
const utf8 = new TextDecoder("utf-8", { fatal: true, ignoreBOM: true });

/**
 * Reads one FlatBuffer for generated code and verifies whatever it reads: bounds, alignment, depth,
 * required fields, zeros behind texts, and UTF-8. A table is known by its position, a field by its
 * slot; a position of 0 stands for an absent field.
 *
 * Each method throws BadValue for bytes that are no FlatBuffer of the schema.
 */
export class TableReader {
  /** The bytes, for structs. */
  readonly view: DataView;
  readonly #bytes: Uint8Array;
  readonly #size: number;
  #depthLeft: number;
  #bytesLeft: number;

  constructor(bytes: Uint8Array, depthMax: number) {
    this.#bytes = bytes;
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    this.#size = bytes.length;
    this.#depthLeft = depthMax;
    this.#bytesLeft = this.#size + Math.min(sharingMax * this.#size + 4096, sharedBytesMax);
  }

  /** The position of the root. */
  root(): number {
    return this.#follow(0);
  }

  /** Begins to read a table; `leave` ends it. */
  enter(table: number): void {
    if (--this.#depthLeft < 0) throw new BadValue("its tables nest too deep");
    this.#check(table, 4, 4);
    const vtable = table - this.view.getInt32(table, true);
    if (vtable < 0 || vtable > this.#size - 4 || vtable % 2 !== 0) {
      throw new BadValue(`the vtable of the table at ${table} is out of bounds`);
    }
    const size = this.view.getUint16(vtable, true);
    if (size < 4 || size % 2 !== 0 || vtable + size > this.#size) {
      throw new BadValue(`the vtable at ${vtable} has a wrong size`);
    }
    this.#charge(size + 4);
  }

  /** Ends reading a table. */
  leave(): void {
    ++this.#depthLeft;
  }

  /** The position of a field of `size` bytes, aligned to `alignment`; 0: absent. */
  field(table: number, slot: number, size: number, alignment: number): number {
    const vtable = table - this.view.getInt32(table, true);
    const entry = 4 + 2 * slot;
    if (entry >= this.view.getUint16(vtable, true)) return 0;
    const offset = this.view.getUint16(vtable + entry, true);
    if (offset === 0) return 0;
    this.#check(table + offset, size, alignment);
    return table + offset;
  }

  /** As `field`, of a required field. */
  required(table: number, slot: number, size: number, alignment: number): number {
    const at = this.field(table, slot, size, alignment);
    if (at === 0) {
      throw new BadValue(`the required slot ${slot} of the table at ${table} is absent`);
    }
    return at;
  }

  /** The position that the offset of a field leads to; 0: absent. */
  reference(table: number, slot: number, isRequired: boolean): number {
    const at = isRequired ? this.required(table, slot, 4, 4) : this.field(table, slot, 4, 4);
    return at === 0 ? 0 : this.#follow(at);
  }

  /** A number; what stands for an absent one is the default, or undefined. */
  bool<D>(table: number, slot: number, absent: D): boolean | D {
    const at = this.field(table, slot, 1, 1);
    return at === 0 ? absent : this.view.getUint8(at) !== 0;
  }
  int8<D>(table: number, slot: number, absent: D): number | D {
    const at = this.field(table, slot, 1, 1);
    return at === 0 ? absent : this.view.getInt8(at);
  }
  uint8<D>(table: number, slot: number, absent: D): number | D {
    const at = this.field(table, slot, 1, 1);
    return at === 0 ? absent : this.view.getUint8(at);
  }
  int16<D>(table: number, slot: number, absent: D): number | D {
    const at = this.field(table, slot, 2, 2);
    return at === 0 ? absent : this.view.getInt16(at, true);
  }
  uint16<D>(table: number, slot: number, absent: D): number | D {
    const at = this.field(table, slot, 2, 2);
    return at === 0 ? absent : this.view.getUint16(at, true);
  }
  int32<D>(table: number, slot: number, absent: D): number | D {
    const at = this.field(table, slot, 4, 4);
    return at === 0 ? absent : this.view.getInt32(at, true);
  }
  uint32<D>(table: number, slot: number, absent: D): number | D {
    const at = this.field(table, slot, 4, 4);
    return at === 0 ? absent : this.view.getUint32(at, true);
  }
  int64<D>(table: number, slot: number, absent: D): bigint | D {
    const at = this.field(table, slot, 8, 8);
    return at === 0 ? absent : this.view.getBigInt64(at, true);
  }
  uint64<D>(table: number, slot: number, absent: D): bigint | D {
    const at = this.field(table, slot, 8, 8);
    return at === 0 ? absent : this.view.getBigUint64(at, true);
  }
  float32<D>(table: number, slot: number, absent: D): number | D {
    const at = this.field(table, slot, 4, 4);
    return at === 0 ? absent : this.view.getFloat32(at, true);
  }
  float64<D>(table: number, slot: number, absent: D): number | D {
    const at = this.field(table, slot, 8, 8);
    return at === 0 ? absent : this.view.getFloat64(at, true);
  }

  /** A text; empty if it is absent. */
  string(table: number, slot: number, isRequired: boolean): string {
    const at = this.reference(table, slot, isRequired);
    return at === 0 ? "" : this.stringAt(at);
  }

  /** The text at a position. */
  stringAt(at: number): string {
    const length = this.#length(at, 1);
    const end = at + 4 + length;
    if (end >= this.#size || this.#bytes[end] !== 0) {
      throw new BadValue(`the text at ${at} has no zero behind it`);
    }
    try {
      return utf8.decode(this.#bytes.subarray(at + 4, end));
    } catch {
      throw new BadValue(`the text at ${at} is not UTF-8`);
    }
  }

  /** A table; undefined if it is absent. */
  table<T>(table: number, slot: number, codec: TableCodec<T>): T | undefined {
    const at = this.reference(table, slot, false);
    return at === 0 ? undefined : codec.read(this, at);
  }
  requiredTable<T>(table: number, slot: number, codec: TableCodec<T>): T {
    return codec.read(this, this.reference(table, slot, true));
  }

  /** A struct; undefined if it is absent. */
  struct<T>(table: number, slot: number, codec: StructCodec<T>): T | undefined {
    const at = this.field(table, slot, codec.size, codec.alignment);
    return at === 0 ? undefined : codec.read(this.view, at);
  }
  requiredStruct<T>(table: number, slot: number, codec: StructCodec<T>): T {
    return codec.read(this.view, this.required(table, slot, codec.size, codec.alignment));
  }

  /** The struct at a position, of a union. */
  structAt<T>(at: number, codec: StructCodec<T>): T {
    this.#check(at, codec.size, codec.alignment);
    this.#charge(codec.size);
    return codec.read(this.view, at);
  }

  /** A union by the slot of its value, behind that of its type; undefined if it is absent. */
  union<T>(table: number, slot: number, codec: UnionCodec<T>): T | undefined {
    const type = this.uint8(table, slot - 1, 0);
    const at = this.reference(table, slot, false);
    if ((type === 0) !== (at === 0)) {
      throw new BadValue(`the union in slot ${slot} has only one of type and value`);
    }
    return at === 0 ? undefined : codec.read(this, type, at);
  }
  requiredUnion<T>(table: number, slot: number, codec: UnionCodec<T>): T {
    const value = this.union(table, slot, codec);
    if (value === undefined) throw new BadValue(`the required union in slot ${slot} is absent`);
    return value;
  }

  /** Numbers; none if they are absent. */
  numbers<A extends Numbers>(
    table: number,
    slot: number,
    type: NumbersType<A>,
    isRequired: boolean,
  ): A {
    const at = this.reference(table, slot, isRequired);
    const size = type.BYTES_PER_ELEMENT;
    const count = at === 0 ? 0 : this.#length(at, size);
    if (count !== 0) this.#check(at + 4, size, size);
    return readNumbers(this.view, count === 0 ? 0 : at + 4, count, type);
  }

  bools(table: number, slot: number, isRequired: boolean): boolean[] {
    return Array.from(this.numbers(table, slot, Uint8Array, isRequired), (value) => value !== 0);
  }

  strings(table: number, slot: number, isRequired: boolean): string[] {
    return this.#list(table, slot, isRequired, (at) => this.stringAt(at));
  }

  tables<T>(table: number, slot: number, codec: TableCodec<T>, isRequired: boolean): T[] {
    return this.#list(table, slot, isRequired, (at) => codec.read(this, at));
  }

  structs<T>(table: number, slot: number, codec: StructCodec<T>, isRequired: boolean): T[] {
    const at = this.reference(table, slot, isRequired);
    const count = at === 0 ? 0 : this.#length(at, codec.size);
    if (count !== 0) this.#check(at + 4, codec.size, codec.alignment);
    const values: T[] = [];
    for (let i = 0; i < count; ++i) values.push(codec.read(this.view, at + 4 + i * codec.size));
    return values;
  }

  unions<T>(table: number, slot: number, codec: UnionCodec<T>, isRequired: boolean): T[] {
    const types = this.numbers(table, slot - 1, Uint8Array, isRequired);
    const values = this.#list(table, slot, isRequired, (at, i) => {
      const type = types[i];
      if (type === undefined || type === 0) {
        throw new BadValue(`a union in the vector in slot ${slot} has no type`);
      }
      return codec.read(this, type, at);
    });
    if (values.length !== types.length) {
      throw new BadValue(`the unions in slot ${slot} have another number of types`);
    }
    return values;
  }

  #list<T>(
    table: number,
    slot: number,
    isRequired: boolean,
    read: (at: number, index: number) => T,
  ): T[] {
    const at = this.reference(table, slot, isRequired);
    const count = at === 0 ? 0 : this.#length(at, 4);
    const values: T[] = [];
    for (let i = 0; i < count; ++i) values.push(read(this.#follow(at + 4 + 4 * i), i));
    return values;
  }

  /** The number of elements of the vector at a position, which then are within bounds. */
  #length(at: number, elementSize: number): number {
    this.#check(at, 4, 4);
    const count = this.view.getUint32(at, true);
    if (count * elementSize > this.#size - at - 4) {
      throw new BadValue(`the vector at ${at} is longer than the message`);
    }
    this.#charge(4 + count * elementSize);
    return count;
  }

  /** The position that the offset at a position leads to. */
  #follow(at: number): number {
    this.#check(at, 4, 4);
    const target = at + this.view.getUint32(at, true);
    if (target === at || target >= this.#size) {
      throw new BadValue(`the offset at ${at} leads out of bounds`);
    }
    return target;
  }

  #check(at: number, size: number, alignment: number): void {
    if (at > this.#size - size) throw new BadValue(`${size} bytes at ${at} are out of bounds`);
    if (at % alignment !== 0) throw new BadValue(`position ${at} is no multiple of ${alignment}`);
  }

  #charge(byteCount: number): void {
    this.#bytesLeft -= byteCount;
    if (this.#bytesLeft < 0) throw new BadValue("too many offsets lead to the same bytes");
  }
}

import {Bytes} from './bytes';

/** A schema, as FlatBuffers' reflection.fbs describes it. */

export const enum BaseType {
  None,
  UType,
  Bool,
  Byte,
  UByte,
  Short,
  UShort,
  Int,
  UInt,
  Long,
  ULong,
  Float,
  Double,
  String,
  Vector,
  Obj,
  Union,
  Array,
}

export interface FieldType {
  readonly base: BaseType;
  /** Set for Vector and Array. */
  readonly element: BaseType;
  /** The index of the object or the enum; -1: neither. */
  readonly index: number;
  /** Set for Array. */
  readonly count: number;
}

export interface SchemaField {
  readonly name: string;
  readonly type: FieldType;
  /** In a struct from its start, in a table in its vtable. */
  readonly offset: number;
  readonly whole: bigint;
  readonly real: number;
  /** The array of which it is an element; empty: none. */
  readonly array: string;
}

export interface SchemaObject {
  readonly name: string;
  readonly isStruct: boolean;
  readonly byteCount: number;
  readonly fields: readonly SchemaField[];
}

export interface Schema {
  readonly objects: readonly SchemaObject[];
  /** The names of each enum's values. */
  readonly enums: readonly ReadonlyMap<number, string>[];
}

/** Offsets in the vtables of reflection.fbs: 4 + 2 * the field's number. */
const kField = {
  objects: 4,
  enums: 6, // Schema
  name: 4,
  fields: 6,
  isStruct: 8,
  byteCount: 12, // Object
  type: 6,
  offset: 10,
  whole: 12,
  real: 14,
  attributes: 22, // Field
  base: 4,
  element: 6,
  index: 8,
  count: 10, // Type
  values: 6,
  value: 6, // Enum, EnumVal
  key: 4, // KeyValue, whose value is at `value`
} as const;

/**
 * The fields of a struct with its arrays, which the console sends as fields `joints_0`, `joints_1` …,
 * because viewers refuse arrays.
 */
function withArrays(fields: readonly SchemaField[]): SchemaField[] {
  const result: SchemaField[] = [];
  for (const field of [...fields].sort((a, b) => a.offset - b.offset)) {
    const last = result.at(-1);
    if (field.array === '') {
      result.push(field);
    } else if (last?.array === field.array) {
      result[result.length - 1] = {...last, type: {...last.type, count: last.type.count + 1}};
    } else {
      const {base, index} = field.type;
      const type = {base: BaseType.Array, element: base, index, count: 1};
      result.push({...field, name: field.array, type});
    }
  }
  return result;
}

class Reader {
  constructor(private readonly bytes: Bytes) {}

  schema(): Schema {
    const root = this.bytes.root();
    return {
      objects: this.each(root, kField.objects, (at) => this.object(at)),
      enums: this.each(root, kField.enums, (at) => this.values(at)),
    };
  }

  private each<T>(table: number, offset: number, read: (at: number) => T): T[] {
    const at = this.bytes.field(table, offset);
    if (at === 0) return [];
    const {start, count} = this.bytes.vector(at, 4);
    return Array.from({length: count}, (_, i) => read(this.bytes.follow(start + 4 * i)));
  }

  private object(table: number): SchemaObject {
    const isStruct = this.bytes.field(table, kField.isStruct);
    const byteCount = this.bytes.field(table, kField.byteCount);
    const fields = this.each(table, kField.fields, (at) => this.field(at));
    const isFixed = isStruct !== 0 && this.bytes.view.getUint8(isStruct) !== 0;
    return {
      name: this.text(table, kField.name),
      isStruct: isFixed,
      byteCount: byteCount === 0 ? 0 : this.bytes.view.getInt32(byteCount, true),
      fields: isFixed ? withArrays(fields) : fields,
    };
  }

  private field(table: number): SchemaField {
    const type = this.bytes.field(table, kField.type);
    const offset = this.bytes.field(table, kField.offset);
    const whole = this.bytes.field(table, kField.whole);
    const real = this.bytes.field(table, kField.real);
    return {
      name: this.text(table, kField.name),
      type: this.type(this.bytes.follow(type)),
      offset: offset === 0 ? 0 : this.bytes.view.getUint16(offset, true),
      whole: whole === 0 ? 0n : this.bytes.view.getBigInt64(whole, true),
      real: real === 0 ? 0 : this.bytes.view.getFloat64(real, true),
      array: this.each(table, kField.attributes, (at) => this.attribute(at)).join(''),
    };
  }

  /** The array's name, if it is that attribute. */
  private attribute(table: number): string {
    return this.text(table, kField.key) === 'rtpm_array' ? this.text(table, kField.value) : '';
  }

  private type(table: number): FieldType {
    const at = (offset: number) => this.bytes.field(table, offset);
    const byte = (where: number) => (where === 0 ? 0 : this.bytes.view.getUint8(where));
    const index = at(kField.index);
    const count = at(kField.count);
    return {
      base: byte(at(kField.base)),
      element: byte(at(kField.element)),
      index: index === 0 ? -1 : this.bytes.view.getInt32(index, true),
      count: count === 0 ? 0 : this.bytes.view.getUint16(count, true),
    };
  }

  private values(table: number): ReadonlyMap<number, string> {
    const pairs = this.each(table, kField.values, (at): [number, string] => {
      const value = this.bytes.field(at, kField.value);
      const number = value === 0 ? 0n : this.bytes.view.getBigInt64(value, true);
      return [Number(number), this.text(at, kField.name)];
    });
    return new Map(pairs);
  }

  private text(table: number, offset: number): string {
    const at = this.bytes.field(table, offset);
    return at === 0 ? '' : this.bytes.text(at);
  }
}

/** Throws RangeError where `bytes` are no schema. */
export function readSchema(bytes: Uint8Array): Schema {
  return new Reader(new Bytes(bytes)).schema();
}

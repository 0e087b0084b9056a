import {Bytes} from './bytes';
import {BaseType, readSchema, type FieldType, type Schema, type SchemaObject} from './schema';

/** A decoded payload. Whole numbers beyond 2^53 are bigints; enums are numbers. */
export type Decoded =
  | null
  | boolean
  | number
  | bigint
  | string
  | readonly Decoded[]
  | {readonly [key: string]: Decoded};
export type DecodedTable = {readonly [key: string]: Decoded};

const kSizes: Readonly<Partial<Record<BaseType, number>>> = {
  [BaseType.UType]: 1,
  [BaseType.Bool]: 1,
  [BaseType.Byte]: 1,
  [BaseType.UByte]: 1,
  [BaseType.Short]: 2,
  [BaseType.UShort]: 2,
  [BaseType.Int]: 4,
  [BaseType.UInt]: 4,
  [BaseType.Float]: 4,
  [BaseType.Long]: 8,
  [BaseType.ULong]: 8,
  [BaseType.Double]: 8,
};
const kDepthMax = 32;

function exact(value: bigint): number | bigint {
  const near = Number(value);
  return Number.isSafeInteger(near) ? near : value;
}

/** Decodes payloads of one root table by the schema that comes with a channel. */
export class Decoder {
  private readonly root: SchemaObject;

  /** Throws RangeError where the schema is broken or has no such table. */
  static of(schemaBytes: Uint8Array, rootName: string): Decoder {
    return new Decoder(readSchema(schemaBytes), rootName);
  }

  constructor(
    private readonly schema: Schema,
    rootName: string,
  ) {
    const root = schema.objects.find((one) => one.name === rootName);
    if (root === undefined || root.isStruct)
      throw new RangeError(`no table ${rootName} in its schema`);
    this.root = root;
  }

  /** Throws RangeError where the payload is broken. */
  decode(payload: Uint8Array): DecodedTable {
    const bytes = new Bytes(payload);
    return this.table(bytes, this.root, bytes.root(), 0);
  }

  private table(bytes: Bytes, object: SchemaObject, at: number, depth: number): DecodedTable {
    if (depth > kDepthMax) throw new RangeError('a payload is nested too deeply');
    const result: Record<string, Decoded> = {};
    for (const field of object.fields) {
      const where = bytes.field(at, field.offset);
      if (where !== 0) {
        result[field.name] = this.value(bytes, field.type, where, depth);
      } else {
        result[field.name] = absent(field.type, field.whole, field.real);
      }
    }
    return result;
  }

  private structure(bytes: Bytes, object: SchemaObject, at: number): DecodedTable {
    const result: Record<string, Decoded> = {};
    for (const field of object.fields) {
      result[field.name] =
        field.type.base === BaseType.Array
          ? this.elements(bytes, field.type, at + field.offset, field.type.count, 0)
          : this.value(bytes, field.type, at + field.offset, 0);
    }
    return result;
  }

  private value(bytes: Bytes, type: FieldType, at: number, depth: number): Decoded {
    switch (type.base) {
      case BaseType.String:
        return bytes.text(at);
      case BaseType.Vector: {
        const {start, count} = bytes.vector(at, this.elementSize(type));
        return this.elements(bytes, type, start, count, depth);
      }
      case BaseType.Obj: {
        const object = this.object(type.index);
        return object.isStruct
          ? this.structure(bytes, object, at)
          : this.table(bytes, object, bytes.follow(at), depth + 1);
      }
      case BaseType.Union: // Its value is not shown: nothing on the page needs one.
        return null;
      default:
        return scalar(bytes.view, type.base, at);
    }
  }

  private elements(
    bytes: Bytes,
    type: FieldType,
    start: number,
    count: number,
    depth: number,
  ): Decoded[] {
    const size = this.elementSize(type);
    const one: FieldType = {
      base: type.element,
      element: BaseType.None,
      index: type.index,
      count: 0,
    };
    return Array.from({length: count}, (_, i) => this.value(bytes, one, start + i * size, depth));
  }

  private elementSize(type: FieldType): number {
    if (type.element === BaseType.Obj) {
      const object = this.object(type.index);
      return object.isStruct ? object.byteCount : 4;
    }
    return kSizes[type.element] ?? 4;
  }

  private object(index: number): SchemaObject {
    const object = this.schema.objects[index];
    if (object === undefined) throw new RangeError('a schema refers to an object that it lacks');
    return object;
  }
}

function absent(type: FieldType, whole: bigint, real: number): Decoded {
  switch (type.base) {
    case BaseType.String:
    case BaseType.Obj:
    case BaseType.Union:
      return null;
    case BaseType.Vector:
      return [];
    case BaseType.Bool:
      return whole !== 0n;
    case BaseType.Float:
    case BaseType.Double:
      return real;
    default:
      return exact(whole);
  }
}

function scalar(view: DataView, type: BaseType, at: number): Decoded {
  switch (type) {
    case BaseType.Bool:
      return view.getUint8(at) !== 0;
    case BaseType.Byte:
      return view.getInt8(at);
    case BaseType.UType:
    case BaseType.UByte:
      return view.getUint8(at);
    case BaseType.Short:
      return view.getInt16(at, true);
    case BaseType.UShort:
      return view.getUint16(at, true);
    case BaseType.Int:
      return view.getInt32(at, true);
    case BaseType.UInt:
      return view.getUint32(at, true);
    case BaseType.Long:
      return exact(view.getBigInt64(at, true));
    case BaseType.ULong:
      return exact(view.getBigUint64(at, true));
    case BaseType.Float:
      return view.getFloat32(at, true);
    case BaseType.Double:
      return view.getFloat64(at, true);
    default:
      return null;
  }
}

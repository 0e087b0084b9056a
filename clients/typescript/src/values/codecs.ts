import { BadValue, type Codec } from "./codec.js";
import { TableReader } from "./reader.js";
import { TableWriter } from "./writer.js";

/** The codec of a struct: its bytes as FlatBuffers lays them out (hp-12-2). */
export interface StructCodec<T> extends Codec<T> {
  /** In bytes. */
  readonly size: number;
  readonly alignment: number;
  /** Reads the struct at a position. */
  read(view: DataView, at: number): T;
  /** Writes the struct to a position, whose bytes are zero. */
  write(view: DataView, at: number, value: T): void;
}

/** The codec of a table, as a FlatBuffer with the table as its root (hp-12-3). */
export interface TableCodec<T> extends Codec<T> {
  /** Reads the table at a position. */
  read(reader: TableReader, at: number): T;
  /** Writes the table at the end. */
  write(writer: TableWriter, value: T): void;
}

/** How a union's members are read and written in tables. */
export interface UnionCodec<T> {
  /** Reads the member of this type at a position; an unknown type as such, without its value. */
  read(reader: TableReader, type: number, at: number): T;
  /** The number of a value's type. @throws BadValue if it is unknown */
  typeOf(value: T): number;
  /** Writes the member that the offset at a position leads to. */
  write(writer: TableWriter, reference: number, value: T): void;
}

/** Runs `action`, and puts the type's name in front of its refusals. */
function named<R>(name: string, action: () => R): R {
  try {
    return action();
  } catch (error) {
    throw error instanceof BadValue ? new BadValue(`${name}: ${error.message}`) : error;
  }
}

/** A refusal that says which field of a struct it means: "forceNewton.y". */
class BadField extends BadValue {
  constructor(
    readonly field: string,
    readonly reason: string,
  ) {
    super(`${field}: ${reason}`);
  }
}

/** Runs `write`, which reads the value field by field, and puts the field's name in refusals. */
function fieldNamed<T extends object>(value: T, write: (value: T) => void): void {
  try {
    write(value);
  } catch (error) {
    if (!(error instanceof BadValue)) throw error;
    // Writes again, to see which field was read last.
    let last = "";
    const observed = new Proxy(value, {
      get: (target, key): unknown => {
        last = String(key);
        return Reflect.get(target, key);
      },
    });
    try {
      write(observed);
    } catch {
      const { field, reason } =
        error instanceof BadField ? error : { field: undefined, reason: error.message };
      throw new BadField(field === undefined ? last : `${last}.${field}`, reason);
    }
  }
}

/** Makes the codec of a struct of `size` bytes. */
export function structCodec<T>(
  name: string,
  size: number,
  alignment: number,
  read: (view: DataView, at: number) => T,
  write: (view: DataView, at: number, value: T) => void,
): StructCodec<T> {
  return {
    size,
    alignment,
    read,
    write: (view, at, value) => {
      if (typeof value !== "object" || value === null) {
        throw new BadValue(`${String(value)} is no struct`);
      }
      fieldNamed(value, (observed) => write(view, at, observed));
    },
    encode(value) {
      const bytes = new Uint8Array(size);
      named(name, () => {
        this.write(new DataView(bytes.buffer), 0, value);
      });
      return bytes;
    },
    decode(bytes) {
      if (bytes.length !== size) {
        throw new BadValue(`${name} has ${size} bytes, not ${bytes.length}`);
      }
      return read(new DataView(bytes.buffer, bytes.byteOffset, size), 0);
    },
  };
}

/**
 * Makes the codec of a table.
 * @param depthMax how deep tables may nest, with the root
 * @param read reads the fields of the table at a position
 * @param write opens a table, adds the fields, closes it, and writes what its offsets lead to
 */
export function tableCodec<T>(
  name: string,
  depthMax: number,
  read: (reader: TableReader, at: number) => T,
  write: (writer: TableWriter, value: T) => void,
): TableCodec<T> {
  return {
    read: (reader, at) => {
      reader.enter(at);
      const value = read(reader, at);
      reader.leave();
      return value;
    },
    write: (writer, value) => {
      if (value === undefined || value === null) throw new BadValue("a table is undefined");
      write(writer, value);
      writer.leave();
    },
    encode(value) {
      return named(name, () => {
        const writer = new TableWriter(depthMax);
        writer.root(this, value);
        return writer.finish();
      });
    },
    decode(bytes) {
      return named(name, () => {
        const reader = new TableReader(bytes, depthMax);
        return this.read(reader, reader.root());
      });
    },
  };
}

/**
 * The codec of a request that also checks its ranges when it decodes.
 * @param check throws BadValue for a value outside them
 */
export function checked<T>(codec: Codec<T>, check: (value: T) => void): Codec<T> {
  return {
    encode: (value) => codec.encode(value),
    decode: (bytes) => {
      const value = codec.decode(bytes);
      check(value);
      return value;
    },
  };
}

/** The fields of a table of which only those in K must be given. */
export type Given<T, K extends keyof T> = Partial<T> & Pick<T, K>;

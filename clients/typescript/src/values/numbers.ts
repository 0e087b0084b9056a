/** The numbers of a vector or array. */
export type Numbers =
  | Int8Array
  | Uint8Array
  | Int16Array
  | Uint16Array
  | Int32Array
  | Uint32Array
  | BigInt64Array
  | BigUint64Array
  | Float32Array
  | Float64Array;

/** The constructor of a typed array, such as Float64Array. */
export interface NumbersType<A extends Numbers> {
  new (buffer: ArrayBuffer): A;
  readonly BYTES_PER_ELEMENT: number;
}

const isLittleEndian = new Uint8Array(Uint16Array.of(1).buffer)[0] === 1;

/** A copy of bytes whose elements have another order on hosts that are big-endian. */
function swapped(bytes: Uint8Array, elementSize: number): Uint8Array {
  const copy = bytes.slice();
  if (!isLittleEndian) {
    for (let at = 0; at < copy.length; at += elementSize) {
      copy.subarray(at, at + elementSize).reverse();
    }
  }
  return copy;
}

/** Reads `count` little-endian numbers at `at`. They share no memory with the view. */
export function readNumbers<A extends Numbers>(
  view: DataView,
  at: number,
  count: number,
  type: NumbersType<A>,
): A {
  const size = type.BYTES_PER_ELEMENT;
  const bytes = new Uint8Array(view.buffer, view.byteOffset + at, count * size);
  return new type(swapped(bytes, size).buffer as ArrayBuffer);
}

/** Writes little-endian numbers to `at`. */
export function writeNumbers(view: DataView, at: number, values: Numbers): void {
  const bytes = new Uint8Array(values.buffer, values.byteOffset, values.byteLength);
  new Uint8Array(view.buffer, view.byteOffset + at, bytes.length).set(
    isLittleEndian ? bytes : swapped(bytes, values.BYTES_PER_ELEMENT),
  );
}

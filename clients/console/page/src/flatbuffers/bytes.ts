/** Reads FlatBuffers. An offset outside of the buffer throws RangeError, by DataView. */
export class Bytes {
  readonly view: DataView;
  private readonly bytes: Uint8Array;
  private static readonly decoder = new TextDecoder();

  constructor(bytes: Uint8Array) {
    this.bytes = bytes;
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  }

  root(): number {
    return this.view.getUint32(0, true);
  }

  /** Where the offset at `at` points. */
  follow(at: number): number {
    return at + this.view.getUint32(at, true);
  }

  /** Where a table's field is, by its offset in the vtable; 0 where it is absent. */
  field(table: number, offset: number): number {
    const vtable = table - this.view.getInt32(table, true);
    if (offset >= this.view.getUint16(vtable, true)) return 0;
    const position = this.view.getUint16(vtable + offset, true);
    return position === 0 ? 0 : table + position;
  }

  /** The text to which the offset at `at` points. */
  text(at: number): string {
    const start = this.follow(at);
    const size = this.view.getUint32(start, true);
    if (start + 4 + size > this.bytes.length) throw new RangeError('a text is cut short');
    return Bytes.decoder.decode(this.bytes.subarray(start + 4, start + 4 + size));
  }

  /** A vector's first element and its count, which fits the buffer. */
  vector(at: number, elementSize: number): {start: number; count: number} {
    const start = this.follow(at);
    const count = this.view.getUint32(start, true);
    if (start + 4 + count * elementSize > this.bytes.length) {
      throw new RangeError('a vector is cut short');
    }
    return {start: start + 4, count};
  }
}

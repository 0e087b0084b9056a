/**
 * Bytes that are no value of their type, or a value that its type cannot encode.
 *
 * A server answers bad_request to a request that decodes with it; a client takes the reply for
 * malformed. The message names the place and the reason, without bytes of the peer.
 */
export class BadValue extends Error {
  override readonly name = "BadValue";
}

/** Turns a value to the payload of a call and back (spec/hprotocol.md, section 12). */
export interface Codec<T> {
  /**
   * Encodes a value to bytes that the caller owns.
   * @throws BadValue if the type cannot hold the value, such as 300 in a byte
   */
  encode(value: T): Uint8Array;
  /**
   * Decodes and verifies a payload. The value shares no memory with the bytes.
   * @throws BadValue if the bytes are no value of the type
   */
  decode(bytes: Uint8Array): T;
}

/** The codec of nothing, `rtpm.Empty` in a schema: undefined, and no bytes (hp-12-1). */
export const nothing: Codec<void> = {
  encode: () => new Uint8Array(0),
  decode: (bytes) => {
    if (bytes.length !== 0) throw new BadValue(`expected nothing, got ${bytes.length} bytes`);
  },
};

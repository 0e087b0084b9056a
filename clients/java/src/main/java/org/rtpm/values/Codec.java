package org.rtpm.values;

import java.nio.ByteBuffer;

/**
 * Turns a value to the payload of a call and back (spec/hprotocol.md, section 12).
 *
 * <p>Threads: any, concurrently.
 */
public interface Codec<T> {
  /**
   * Encodes a value.
   *
   * @return the bytes of a payload, owned by the caller
   * @throws BadValue if the type cannot hold the value, such as 300 in a byte
   */
  byte[] encode(T value);

  /**
   * Decodes and verifies a payload. The value shares no memory with the bytes.
   *
   * @param bytes from position to limit; neither these nor the byte order are changed
   * @throws BadValue if the bytes are no value of the type
   */
  T decode(ByteBuffer bytes);

  /** The size of every value in bytes; -1 if it depends on the value. */
  default int fixedSize() {
    return -1;
  }
}

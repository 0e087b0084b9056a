package org.rtpm;

import java.nio.ByteBuffer;
import org.rtpm.values.Codec;

/** Payloads as they are, for methods of tests. */
public final class BytesCodec implements Codec<byte[]> {
  public static final Codec<byte[]> BYTES = new BytesCodec();

  private BytesCodec() {}

  @Override
  public byte[] encode(byte[] value) {
    return value;
  }

  @Override
  public byte[] decode(ByteBuffer bytes) {
    byte[] value = new byte[bytes.remaining()];
    bytes.duplicate().get(value);
    return value;
  }
}

package org.rtpm.values;

import java.nio.ByteBuffer;
import java.util.function.Consumer;

/** Codecs that belong to no schema. */
public final class Codecs {
  private static final byte[] NO_BYTES = {};

  /** The codec of nothing, {@code rtpm.Empty} in a schema: null, and no bytes (hp-12-1). */
  public static final Codec<Void> NOTHING =
      new Codec<>() {
        @Override
        public byte[] encode(Void value) {
          return NO_BYTES;
        }

        @Override
        public Void decode(ByteBuffer bytes) {
          if (bytes.hasRemaining()) {
            throw new BadValue("expected nothing, got " + bytes.remaining() + " bytes");
          }
          return null;
        }

        @Override
        public int fixedSize() {
          return 0;
        }
      };

  private Codecs() {}

  /**
   * The codec of a request that also checks its ranges when it decodes.
   *
   * @param check throws {@link BadValue} for a value outside them
   */
  public static <T> Codec<T> checked(Codec<T> codec, Consumer<T> check) {
    return new Codec<>() {
      @Override
      public byte[] encode(T value) {
        return codec.encode(value);
      }

      @Override
      public T decode(ByteBuffer bytes) {
        T value = codec.decode(bytes);
        check.accept(value);
        return value;
      }

      @Override
      public int fixedSize() {
        return codec.fixedSize();
      }
    };
  }
}

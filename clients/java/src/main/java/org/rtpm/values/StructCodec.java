package org.rtpm.values;

import java.nio.ByteBuffer;
import java.nio.ByteOrder;

/**
 * The codec of a struct: its bytes as FlatBuffers lays them out (hp-12-2).
 *
 * <p>Threads: any, concurrently.
 */
public final class StructCodec<T> implements Codec<T> {
  private final String name;
  private final int size;
  private final int alignment;
  private final Reading<T> reading;
  private final Writing<T> writing;

  /**
   * Creates a codec.
   *
   * @param size in bytes
   */
  public StructCodec(
      String name, int size, int alignment, Reading<T> reading, Writing<T> writing) {
    this.name = name;
    this.size = size;
    this.alignment = alignment;
    this.reading = reading;
    this.writing = writing;
  }

  /** The size in bytes. */
  public int size() {
    return size;
  }

  @Override
  public int fixedSize() {
    return size;
  }

  /** The alignment in bytes. */
  public int alignment() {
    return alignment;
  }

  @Override
  public byte[] encode(T value) {
    ByteBuffer bytes = ByteBuffer.allocate(size).order(ByteOrder.LITTLE_ENDIAN);
    try {
      write(bytes, 0, value);
    } catch (BadValue wrong) {
      throw new BadValue(name + ": " + wrong.getMessage());
    }
    return bytes.array();
  }

  @Override
  public T decode(ByteBuffer bytes) {
    if (bytes.remaining() != size) {
      throw new BadValue(name + " has " + size + " bytes, not " + bytes.remaining());
    }
    return read(bytes.slice().order(ByteOrder.LITTLE_ENDIAN), 0);
  }

  /** Reads the struct at a position of a little-endian buffer. */
  public T read(ByteBuffer bytes, int at) {
    return reading.read(bytes, at);
  }

  /** Writes the struct to a position of a little-endian buffer, whose bytes there are zero. */
  public void write(ByteBuffer bytes, int at, T value) {
    if (value == null) {
      throw new BadValue("a struct is null");
    }
    writing.write(bytes, at, value);
  }

  /** Reads a struct. */
  @FunctionalInterface
  public interface Reading<T> {
    /** Reads the struct at a position. */
    T read(ByteBuffer bytes, int at);
  }

  /** Writes a struct. */
  @FunctionalInterface
  public interface Writing<T> {
    /** Writes the struct to a position. */
    void write(ByteBuffer bytes, int at, T value);
  }
}

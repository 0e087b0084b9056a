package org.rtpm.values;

import java.nio.ByteBuffer;

/**
 * The codec of a table, as a FlatBuffer with the table as its root (hp-12-3).
 *
 * <p>Threads: any, concurrently.
 */
public final class TableCodec<T> implements Codec<T> {
  private final String name;
  private final int depthMax;
  private final Reading<T> reading;
  private final Writing<T> writing;

  /**
   * Creates a codec.
   *
   * @param depthMax how deep tables may nest, with the root
   */
  public TableCodec(String name, int depthMax, Reading<T> reading, Writing<T> writing) {
    this.name = name;
    this.depthMax = depthMax;
    this.reading = reading;
    this.writing = writing;
  }

  @Override
  public byte[] encode(T value) {
    try {
      TableWriter writer = new TableWriter(depthMax);
      writer.root(this, value);
      return writer.finish();
    } catch (BadValue wrong) {
      throw new BadValue(name + ": " + wrong.getMessage());
    }
  }

  @Override
  public T decode(ByteBuffer bytes) {
    try {
      TableReader reader = new TableReader(bytes, depthMax);
      return read(reader, reader.root());
    } catch (BadValue wrong) {
      throw new BadValue(name + ": " + wrong.getMessage());
    }
  }

  /** Reads the table at a position. */
  public T read(TableReader reader, int at) {
    reader.enter(at);
    T value = reading.read(reader, at);
    reader.leave();
    return value;
  }

  /** Writes a table at the end. */
  public void write(TableWriter writer, T value) {
    if (value == null) {
      throw new BadValue("a table is null");
    }
    writing.write(writer, value);
    writer.leave();
  }

  /** Reads the fields of a table. */
  @FunctionalInterface
  public interface Reading<T> {
    /** Reads the fields of the table at a position. */
    T read(TableReader reader, int at);
  }

  /** Writes a table. */
  @FunctionalInterface
  public interface Writing<T> {
    /** Opens a table, adds the fields, closes it, and writes what its offsets lead to. */
    void write(TableWriter writer, T value);
  }
}

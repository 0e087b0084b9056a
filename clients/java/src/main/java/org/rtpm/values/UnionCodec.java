package org.rtpm.values;

/**
 * How a union's members are read and written in tables, for generated code.
 *
 * <p>Threads: any, concurrently.
 */
public interface UnionCodec<T> {
  /** Reads the member of this type at a position; an unknown type as such, without its value. */
  T read(TableReader reader, int type, int at);

  /**
   * The number of a value's type.
   *
   * @throws BadValue if it is null or unknown
   */
  int typeOf(T value);

  /** Writes the member that the offset at a position leads to. */
  void write(TableWriter writer, int reference, T value);

  /** Refuses to encode a value without a number. */
  static int refuse(String name, Object value) {
    throw new BadValue(
        name + (value == null ? ": the union is null" : ": the union's member is unknown"));
  }
}

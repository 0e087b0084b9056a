package org.rtpm.values;

import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.charset.StandardCharsets;
import java.util.Arrays;
import java.util.List;
import java.util.function.ToLongFunction;

/**
 * Builds one FlatBuffer for generated code, front to back: a table, its vtable, then what its
 * offsets lead to. Between {@link #open} and {@link #close} come the table's fields; the methods
 * with the position of an offset come behind it.
 *
 * <p>Threads: one.
 */
public final class TableWriter {
  private static final int SIZE_MAX = 1 << 30;
  private static final int VTABLE_MEMORY = 32;

  private ByteBuffer bytes = ByteBuffer.allocate(256).order(ByteOrder.LITTLE_ENDIAN);
  private int end = 4;
  private int depthLeft;
  private int table;
  private int slotCount;
  private int[] slots = new int[16];
  private final int[] vtables = new int[VTABLE_MEMORY];
  private int vtableCount;

  TableWriter(int depthMax) {
    depthLeft = depthMax;
  }

  /** The finished message, whose root the offset at 0 leads to. */
  byte[] finish() {
    return Arrays.copyOf(bytes.array(), end);
  }

  /** Begins a table with so many slots. */
  public void open(int slotCount) {
    if (--depthLeft < 0) {
      throw new BadValue("its tables nest too deep");
    }
    if (slots.length < slotCount) {
      slots = new int[slotCount];
    }
    Arrays.fill(slots, 0, slotCount, 0);
    this.slotCount = slotCount;
    table = reserve(4, 4);
  }

  /** Ends the table's fields; the targets of its offsets follow, then {@link #leave}. */
  public void close() {
    int tableSize = end - table;
    if (tableSize > 0xffff) {
      throw new BadValue("a table's fields are larger than 65535 bytes");
    }
    while (slotCount > 0 && slots[slotCount - 1] == 0) {
      --slotCount;
    }
    int vtable = reserve(4 + 2 * slotCount, 2);
    bytes.putShort(vtable, (short) (4 + 2 * slotCount));
    bytes.putShort(vtable + 2, (short) tableSize);
    for (int i = 0; i < slotCount; ++i) {
      bytes.putShort(vtable + 4 + 2 * i, (short) (slots[i] == 0 ? 0 : slots[i] - table));
    }
    bytes.putInt(table, table - shared(vtable));
  }

  /** Ends a table with all that its offsets lead to. */
  public void leave() {
    ++depthLeft;
  }

  /** Adds a number, unless it is the default. */
  public void bool(int slot, boolean value, boolean absent) {
    if (value != absent) {
      bool(slot, value);
    }
  }

  /** As {@link #bool(int, boolean, boolean)}. */
  public void int8(int slot, int value, int absent) {
    if (value != absent) {
      int8(slot, value);
    }
  }

  /** As {@link #bool(int, boolean, boolean)}. */
  public void uint8(int slot, int value, int absent) {
    if (value != absent) {
      uint8(slot, value);
    }
  }

  /** As {@link #bool(int, boolean, boolean)}. */
  public void int16(int slot, int value, int absent) {
    if (value != absent) {
      int16(slot, value);
    }
  }

  /** As {@link #bool(int, boolean, boolean)}. */
  public void uint16(int slot, int value, int absent) {
    if (value != absent) {
      uint16(slot, value);
    }
  }

  /** As {@link #bool(int, boolean, boolean)}. */
  public void int32(int slot, int value, int absent) {
    if (value != absent) {
      int32(slot, value);
    }
  }

  /** As {@link #bool(int, boolean, boolean)}. */
  public void uint32(int slot, long value, long absent) {
    if (value != absent) {
      uint32(slot, value);
    }
  }

  /** As {@link #bool(int, boolean, boolean)}; of unsigned 64 bits, too. */
  public void int64(int slot, long value, long absent) {
    if (value != absent) {
      int64(slot, value);
    }
  }

  /** As {@link #bool(int, boolean, boolean)}. */
  public void float32(int slot, float value, float absent) {
    if (Float.floatToRawIntBits(value) != Float.floatToRawIntBits(absent)) {
      float32(slot, value);
    }
  }

  /** As {@link #bool(int, boolean, boolean)}. */
  public void float64(int slot, double value, double absent) {
    if (Double.doubleToRawLongBits(value) != Double.doubleToRawLongBits(absent)) {
      float64(slot, value);
    }
  }

  /** Adds a number. */
  public void bool(int slot, boolean value) {
    int at = inline(slot, 1, 1);
    bytes.put(at, (byte) (value ? 1 : 0));
  }

  /**
   * Adds a number.
   *
   * @throws BadValue if the type cannot hold it
   */
  public void int8(int slot, int value) {
    int at = inline(slot, 1, 1);
    bytes.put(at, Scalars.int8(value));
  }

  /** As {@link #int8(int, int)}. */
  public void uint8(int slot, int value) {
    int at = inline(slot, 1, 1);
    bytes.put(at, Scalars.uint8(value));
  }

  /** As {@link #int8(int, int)}. */
  public void int16(int slot, int value) {
    int at = inline(slot, 2, 2);
    bytes.putShort(at, Scalars.int16(value));
  }

  /** As {@link #int8(int, int)}. */
  public void uint16(int slot, int value) {
    int at = inline(slot, 2, 2);
    bytes.putShort(at, Scalars.uint16(value));
  }

  /** Adds a number. */
  public void int32(int slot, int value) {
    int at = inline(slot, 4, 4);
    bytes.putInt(at, value);
  }

  /** As {@link #int8(int, int)}. */
  public void uint32(int slot, long value) {
    int at = inline(slot, 4, 4);
    bytes.putInt(at, Scalars.uint32(value));
  }

  /** Adds a number. */
  public void int64(int slot, long value) {
    int at = inline(slot, 8, 8);
    bytes.putLong(at, value);
  }

  /** Adds a number. */
  public void float32(int slot, float value) {
    int at = inline(slot, 4, 4);
    bytes.putFloat(at, value);
  }

  /** Adds a number. */
  public void float64(int slot, double value) {
    int at = inline(slot, 8, 8);
    bytes.putDouble(at, value);
  }

  /** Adds a struct, unless it is null. */
  public <T> void struct(int slot, StructCodec<T> codec, T value) {
    if (value != null) {
      int at = inline(slot, codec.size(), codec.alignment());
      codec.write(bytes, at, value);
    }
  }

  /**
   * As {@link #struct}, of a required one.
   *
   * @throws BadValue if it is null
   */
  public <T> void requiredStruct(int slot, String name, StructCodec<T> codec, T value) {
    if (value == null) {
      throw new BadValue(name + " is null, but required");
    }
    struct(slot, codec, value);
  }

  /**
   * Adds an offset, if {@code isPresent}.
   *
   * @return its position; 0 without it
   */
  public int reference(int slot, boolean isPresent) {
    return isPresent ? inline(slot, 4, 4) : 0;
  }

  /**
   * Adds the offset of what may be absent.
   *
   * @return its position; 0 if the value is null
   */
  public int reference(int slot, Object value) {
    return reference(slot, value != null);
  }

  /**
   * Adds a required offset.
   *
   * @return its position
   * @throws BadValue if the value is null
   */
  public int required(int slot, String name, Object value) {
    if (value == null) {
      throw new BadValue(name + " is null, but required");
    }
    return inline(slot, 4, 4);
  }

  /** Writes a text that the offset at a position leads to; nothing if that is 0. */
  public void string(int reference, String value) {
    if (reference == 0) {
      return;
    }
    checkUtf16(value);
    byte[] content = value.getBytes(StandardCharsets.UTF_8);
    int at = vector(reference, content.length, 1, 1, 1);
    bytes.put(at, content);
  }

  /** As {@link #string}. */
  public <T> void table(int reference, TableCodec<T> codec, T value) {
    if (reference != 0) {
      point(reference, 4, 0);
      codec.write(this, value);
    }
  }

  /** Writes the root, which the offset at 0 leads to. */
  <T> void root(TableCodec<T> codec, T value) {
    point(0, 4, 0);
    codec.write(this, value);
  }

  /** Writes the struct of a union. */
  public <T> void structAt(int reference, StructCodec<T> codec, T value) {
    point(reference, codec.alignment(), 0);
    int at = reserve(codec.size(), codec.alignment());
    codec.write(bytes, at, value);
  }

  /** As {@link #string}. */
  public <T> void union(int reference, UnionCodec<T> codec, T value) {
    if (reference != 0) {
      codec.write(this, reference, value);
    }
  }

  /** As {@link #string}. */
  public void bools(int reference, boolean[] values) {
    if (reference != 0) {
      int at = vector(reference, values.length, 1, 1, 0);
      ScalarArrays.bools(bytes, at, values.length, values);
    }
  }

  /** As {@link #string}. */
  public void bytes(int reference, byte[] values) {
    if (reference != 0) {
      int at = vector(reference, values.length, 1, 1, 0);
      ScalarArrays.bytes(bytes, at, values.length, values);
    }
  }

  /** As {@link #string}. */
  public void int16s(int reference, short[] values) {
    if (reference != 0) {
      int at = vector(reference, values.length, 2, 2, 0);
      ScalarArrays.int16s(bytes, at, values.length, values);
    }
  }

  /** As {@link #string}. */
  public void uint16s(int reference, int[] values) {
    if (reference != 0) {
      int at = vector(reference, values.length, 2, 2, 0);
      ScalarArrays.uint16s(bytes, at, values.length, values);
    }
  }

  /** As {@link #string}. */
  public void int32s(int reference, int[] values) {
    if (reference != 0) {
      int at = vector(reference, values.length, 4, 4, 0);
      ScalarArrays.int32s(bytes, at, values.length, values);
    }
  }

  /** As {@link #string}. */
  public void uint32s(int reference, long[] values) {
    if (reference != 0) {
      int at = vector(reference, values.length, 4, 4, 0);
      ScalarArrays.uint32s(bytes, at, values.length, values);
    }
  }

  /** As {@link #string}; of unsigned 64 bits, too. */
  public void int64s(int reference, long[] values) {
    if (reference != 0) {
      int at = vector(reference, values.length, 8, 8, 0);
      ScalarArrays.int64s(bytes, at, values.length, values);
    }
  }

  /** As {@link #string}. */
  public void float32s(int reference, float[] values) {
    if (reference != 0) {
      int at = vector(reference, values.length, 4, 4, 0);
      ScalarArrays.float32s(bytes, at, values.length, values);
    }
  }

  /** As {@link #string}. */
  public void float64s(int reference, double[] values) {
    if (reference != 0) {
      int at = vector(reference, values.length, 8, 8, 0);
      ScalarArrays.float64s(bytes, at, values.length, values);
    }
  }

  /** As {@link #string}; values of an enumeration of so many bytes. */
  public <T> void enums(
      int reference, int size, boolean isSigned, List<T> values, ToLongFunction<T> number) {
    if (reference == 0) {
      return;
    }
    int at = vector(reference, values.size(), size, size, 0);
    for (int i = 0; i < values.size(); ++i) {
      Scalars.integer(bytes, at + i * size, size, isSigned, number.applyAsLong(values.get(i)));
    }
  }

  /** As {@link #string}. */
  public void strings(int reference, List<String> values) {
    if (reference == 0) {
      return;
    }
    int at = vector(reference, values.size(), 4, 4, 0);
    for (int i = 0; i < values.size(); ++i) {
      string(at + 4 * i, values.get(i));
    }
  }

  /** As {@link #string}. */
  public <T> void tables(int reference, TableCodec<T> codec, List<T> values) {
    if (reference == 0) {
      return;
    }
    int at = vector(reference, values.size(), 4, 4, 0);
    for (int i = 0; i < values.size(); ++i) {
      table(at + 4 * i, codec, values.get(i));
    }
  }

  /** As {@link #string}. */
  public <T> void structs(int reference, StructCodec<T> codec, List<T> values) {
    if (reference == 0) {
      return;
    }
    int at = vector(reference, values.size(), codec.size(), codec.alignment(), 0);
    for (int i = 0; i < values.size(); ++i) {
      codec.write(bytes, at + i * codec.size(), values.get(i));
    }
  }

  /** As {@link #string}; {@code types} is the offset of the vector of the types. */
  public <T> void unions(int types, int reference, UnionCodec<T> codec, List<T> values) {
    if (reference == 0) {
      return;
    }
    byte[] numbers = new byte[values.size()];
    for (int i = 0; i < numbers.length; ++i) {
      numbers[i] = (byte) codec.typeOf(values.get(i));
    }
    bytes(types, numbers);
    int at = vector(reference, numbers.length, 4, 4, 0);
    for (int i = 0; i < numbers.length; ++i) {
      codec.write(this, at + 4 * i, values.get(i));
    }
  }

  /** The position of a new field. The buffer may be another one after it. */
  private int inline(int slot, int fieldSize, int alignment) {
    int at = reserve(fieldSize, alignment);
    slots[slot] = at;
    return at;
  }

  /** The position of so many new zeros. */
  private int reserve(long byteCount, int alignment) {
    align(alignment, 0);
    if (byteCount > SIZE_MAX - end) {
      throw new BadValue("it is larger than " + SIZE_MAX + " bytes");
    }
    int at = end;
    end += (int) byteCount;
    if (end > bytes.capacity()) {
      byte[] larger = Arrays.copyOf(bytes.array(), Math.max(end, 2 * bytes.capacity()));
      bytes = ByteBuffer.wrap(larger).order(ByteOrder.LITTLE_ENDIAN);
    }
    return at;
  }

  /** Moves the end to where {@code lead} bytes more are aligned. */
  private void align(int alignment, int lead) {
    end += Math.floorMod(-(end + lead), alignment);
  }

  /** Lets the offset at a position lead to the end. */
  private void point(int reference, int alignment, int lead) {
    align(alignment, lead);
    bytes.putInt(reference, end - reference);
  }

  /**
   * Begins a vector.
   *
   * @return the position of its elements
   */
  private int vector(int reference, int count, int size, int alignment, int extra) {
    point(reference, Math.max(alignment, 4), 4);
    int at = reserve(4 + (long) count * size + extra, 1);
    bytes.putInt(at, count);
    return at + 4;
  }

  /** An equal vtable from before, which then replaces the new one at the end. */
  private int shared(int vtable) {
    int vtableSize = end - vtable;
    byte[] all = bytes.array();
    for (int i = 0; i < vtableCount; ++i) {
      int other = vtables[i];
      if (Scalars.uint16(bytes, other) == vtableSize
          && Arrays.equals(all, other, other + vtableSize, all, vtable, end)) {
        Arrays.fill(all, vtable, end, (byte) 0);
        end = vtable;
        return other;
      }
    }
    if (vtableCount < VTABLE_MEMORY) {
      vtables[vtableCount++] = vtable;
    }
    return vtable;
  }

  private static void checkUtf16(String value) {
    for (int i = 0; i < value.length(); ++i) {
      if (!Character.isSurrogate(value.charAt(i))) {
        continue;
      }
      char next = i + 1 < value.length() ? value.charAt(i + 1) : 0;
      if (!Character.isSurrogatePair(value.charAt(i), next)) {
        throw new BadValue("a text has half a surrogate pair, which UTF-8 cannot express");
      }
      ++i;
    }
  }
}

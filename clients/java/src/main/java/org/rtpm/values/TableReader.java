package org.rtpm.values;

import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.charset.CharacterCodingException;
import java.nio.charset.StandardCharsets;
import java.util.ArrayList;
import java.util.List;
import java.util.function.LongFunction;

/**
 * Reads one FlatBuffer for generated code and verifies whatever it reads: bounds, alignment, depth,
 * required fields, zeros behind texts, and UTF-8. A table is known by its position, a field by its
 * slot; a position of 0 stands for an absent field.
 *
 * <p>Each method throws {@link BadValue} for bytes that are no FlatBuffer of the schema.
 *
 * <p>Threads: one.
 */
public final class TableReader {
  // Offsets may point to the same bytes more than once. Without a limit, a small message could
  // become values without bound.
  private static final int SHARING_MAX = 64;
  private static final int SHARED_BYTES_MAX = 64 << 20;

  private final ByteBuffer bytes;
  private final int size;
  private int depthLeft;
  private long bytesLeft;

  TableReader(ByteBuffer bytes, int depthMax) {
    this.bytes = bytes.slice().order(ByteOrder.LITTLE_ENDIAN);
    size = this.bytes.limit();
    depthLeft = depthMax;
    bytesLeft = size + Math.min((long) SHARING_MAX * size + 4096, SHARED_BYTES_MAX);
  }

  /** The bytes, little-endian, for structs. */
  public ByteBuffer bytes() {
    return bytes;
  }

  int root() {
    return follow(0);
  }

  /** Begins to read a table; {@link #leave} ends it. */
  public void enter(int table) {
    if (--depthLeft < 0) {
      throw new BadValue("its tables nest too deep");
    }
    check(table, 4, 4);
    long vtable = (long) table - bytes.getInt(table);
    if (vtable < 0 || vtable > size - 4 || vtable % 2 != 0) {
      throw new BadValue("the vtable of the table at " + table + " is out of bounds");
    }
    int vtableSize = vtableSize((int) vtable);
    if (vtableSize < 4 || vtableSize % 2 != 0 || vtable + vtableSize > size) {
      throw new BadValue("the vtable at " + vtable + " has a wrong size");
    }
    charge(vtableSize + 4);
  }

  /** Ends reading a table. */
  public void leave() {
    ++depthLeft;
  }

  /** The position of a field of so many bytes, aligned to {@code alignment}; 0: absent. */
  public int field(int table, int slot, int fieldSize, int alignment) {
    int vtable = table - bytes.getInt(table);
    int entry = 4 + 2 * slot;
    if (entry >= vtableSize(vtable)) {
      return 0;
    }
    int offset = Scalars.uint16(bytes, vtable + entry);
    if (offset == 0) {
      return 0;
    }
    long at = (long) table + offset;
    if (at > size) {
      throw new BadValue("slot " + slot + " of the table at " + table + " is out of bounds");
    }
    check((int) at, fieldSize, alignment);
    return (int) at;
  }

  /** As {@link #field}, of a required field. */
  public int required(int table, int slot, int fieldSize, int alignment) {
    int at = field(table, slot, fieldSize, alignment);
    if (at == 0) {
      throw new BadValue("the required slot " + slot + " of the table at " + table + " is absent");
    }
    return at;
  }

  /** The position that the offset of a field leads to; 0: absent. */
  public int reference(int table, int slot, boolean isRequired) {
    int at = isRequired ? required(table, slot, 4, 4) : field(table, slot, 4, 4);
    return at == 0 ? 0 : follow(at);
  }

  /** A number; the default if it is absent. */
  public boolean bool(int table, int slot, boolean absent) {
    int at = field(table, slot, 1, 1);
    return at == 0 ? absent : bytes.get(at) != 0;
  }

  /** As {@link #bool}. */
  public int int8(int table, int slot, int absent) {
    int at = field(table, slot, 1, 1);
    return at == 0 ? absent : bytes.get(at);
  }

  /** As {@link #bool}. */
  public int uint8(int table, int slot, int absent) {
    int at = field(table, slot, 1, 1);
    return at == 0 ? absent : Scalars.uint8(bytes, at);
  }

  /** As {@link #bool}. */
  public int int16(int table, int slot, int absent) {
    int at = field(table, slot, 2, 2);
    return at == 0 ? absent : bytes.getShort(at);
  }

  /** As {@link #bool}. */
  public int uint16(int table, int slot, int absent) {
    int at = field(table, slot, 2, 2);
    return at == 0 ? absent : Scalars.uint16(bytes, at);
  }

  /** As {@link #bool}. */
  public int int32(int table, int slot, int absent) {
    int at = field(table, slot, 4, 4);
    return at == 0 ? absent : bytes.getInt(at);
  }

  /** As {@link #bool}. */
  public long uint32(int table, int slot, long absent) {
    int at = field(table, slot, 4, 4);
    return at == 0 ? absent : Scalars.uint32(bytes, at);
  }

  /** As {@link #bool}; of unsigned 64 bits, too. */
  public long int64(int table, int slot, long absent) {
    int at = field(table, slot, 8, 8);
    return at == 0 ? absent : bytes.getLong(at);
  }

  /** As {@link #bool}. */
  public float float32(int table, int slot, float absent) {
    int at = field(table, slot, 4, 4);
    return at == 0 ? absent : bytes.getFloat(at);
  }

  /** As {@link #bool}. */
  public double float64(int table, int slot, double absent) {
    int at = field(table, slot, 8, 8);
    return at == 0 ? absent : bytes.getDouble(at);
  }

  /** Whether a number is there, for those with the default null. */
  public boolean has(int table, int slot) {
    return field(table, slot, 1, 1) != 0;
  }

  /** A text; empty if it is absent. */
  public String string(int table, int slot, boolean isRequired) {
    int at = reference(table, slot, isRequired);
    return at == 0 ? "" : stringAt(at);
  }

  /** The text at a position. */
  public String stringAt(int at) {
    int length = length(at, 1);
    long end = at + 4L + length;
    if (end >= size || bytes.get((int) end) != 0) {
      throw new BadValue("the text at " + at + " has no zero behind it");
    }
    byte[] content = new byte[length];
    bytes.get(at + 4, content);
    String text = new String(content, StandardCharsets.UTF_8);
    // The constructor replaces wrong bytes, which a text may contain itself.
    if (text.indexOf('\uFFFD') >= 0) {
      try {
        StandardCharsets.UTF_8.newDecoder().decode(ByteBuffer.wrap(content));
      } catch (CharacterCodingException wrong) {
        throw new BadValue("the text at " + at + " is not UTF-8");
      }
    }
    return text;
  }

  /** A table; null if it is absent. */
  public <T> T table(int table, int slot, TableCodec<T> codec, boolean isRequired) {
    int at = reference(table, slot, isRequired);
    return at == 0 ? null : codec.read(this, at);
  }

  /** A struct; null if it is absent. */
  public <T> T struct(int table, int slot, StructCodec<T> codec, boolean isRequired) {
    int at =
        isRequired
            ? required(table, slot, codec.size(), codec.alignment())
            : field(table, slot, codec.size(), codec.alignment());
    return at == 0 ? null : codec.read(bytes, at);
  }

  /** The struct at a position, of a union. */
  public <T> T structAt(int at, StructCodec<T> codec) {
    check(at, codec.size(), codec.alignment());
    charge(codec.size());
    return codec.read(bytes, at);
  }

  /** A union by the slot of its value, behind that of its type; null if it is absent. */
  public <T> T union(int table, int slot, UnionCodec<T> codec, boolean isRequired) {
    int type = uint8(table, slot - 1, 0);
    int at = reference(table, slot, isRequired);
    if (type == 0 || at == 0) {
      if (isRequired || (type == 0) != (at == 0)) {
        throw new BadValue("the union in slot " + slot + " has only one of type and value");
      }
      return null;
    }
    return codec.read(this, type, at);
  }

  /** Numbers; none if they are absent. */
  public boolean[] bools(int table, int slot, boolean isRequired) {
    int at = vector(table, slot, 1, isRequired);
    return ScalarArrays.bools(bytes, at + 4, count(at));
  }

  /** As {@link #bools}; signed or unsigned bytes. */
  public byte[] bytes(int table, int slot, boolean isRequired) {
    int at = vector(table, slot, 1, isRequired);
    return ScalarArrays.bytes(bytes, at + 4, count(at));
  }

  /** As {@link #bools}. */
  public short[] int16s(int table, int slot, boolean isRequired) {
    int at = vector(table, slot, 2, isRequired);
    return ScalarArrays.int16s(bytes, at + 4, count(at));
  }

  /** As {@link #bools}. */
  public int[] uint16s(int table, int slot, boolean isRequired) {
    int at = vector(table, slot, 2, isRequired);
    return ScalarArrays.uint16s(bytes, at + 4, count(at));
  }

  /** As {@link #bools}. */
  public int[] int32s(int table, int slot, boolean isRequired) {
    int at = vector(table, slot, 4, isRequired);
    return ScalarArrays.int32s(bytes, at + 4, count(at));
  }

  /** As {@link #bools}. */
  public long[] uint32s(int table, int slot, boolean isRequired) {
    int at = vector(table, slot, 4, isRequired);
    return ScalarArrays.uint32s(bytes, at + 4, count(at));
  }

  /** As {@link #bools}; of unsigned 64 bits, too. */
  public long[] int64s(int table, int slot, boolean isRequired) {
    int at = vector(table, slot, 8, isRequired);
    return ScalarArrays.int64s(bytes, at + 4, count(at));
  }

  /** As {@link #bools}. */
  public float[] float32s(int table, int slot, boolean isRequired) {
    int at = vector(table, slot, 4, isRequired);
    return ScalarArrays.float32s(bytes, at + 4, count(at));
  }

  /** As {@link #bools}. */
  public double[] float64s(int table, int slot, boolean isRequired) {
    int at = vector(table, slot, 8, isRequired);
    return ScalarArrays.float64s(bytes, at + 4, count(at));
  }

  /** Values of an enumeration; an empty list if they are absent. */
  public <T> List<T> enums(
      int table, int slot, boolean isRequired, int size, boolean isSigned, LongFunction<T> make) {
    int at = vector(table, slot, size, isRequired);
    return ScalarArrays.list(
        count(at), i -> make.apply(Scalars.integer(bytes, at + 4 + i * size, size, isSigned)));
  }

  /** Texts; an empty list if they are absent. */
  public List<String> strings(int table, int slot, boolean isRequired) {
    int at = reference(table, slot, isRequired);
    int count = at == 0 ? 0 : length(at, 4);
    List<String> values = new ArrayList<>(count);
    for (int i = 0; i < count; ++i) {
      values.add(stringAt(follow(at + 4 + 4 * i)));
    }
    return List.copyOf(values);
  }

  /** Tables; an empty list if they are absent. */
  public <T> List<T> tables(int table, int slot, TableCodec<T> codec, boolean isRequired) {
    int at = reference(table, slot, isRequired);
    int count = at == 0 ? 0 : length(at, 4);
    List<T> values = new ArrayList<>(count);
    for (int i = 0; i < count; ++i) {
      values.add(codec.read(this, follow(at + 4 + 4 * i)));
    }
    return List.copyOf(values);
  }

  /** Structs; an empty list if they are absent. */
  public <T> List<T> structs(int table, int slot, StructCodec<T> codec, boolean isRequired) {
    int at = reference(table, slot, isRequired);
    int count = at == 0 ? 0 : length(at, codec.size());
    if (count != 0) {
      check(at + 4, codec.size(), codec.alignment());
    }
    List<T> values = new ArrayList<>(count);
    for (int i = 0; i < count; ++i) {
      values.add(codec.read(bytes, at + 4 + i * codec.size()));
    }
    return List.copyOf(values);
  }

  /** Unions; an empty list if they are absent. */
  public <T> List<T> unions(int table, int slot, UnionCodec<T> codec, boolean isRequired) {
    byte[] types = bytes(table, slot - 1, isRequired);
    int at = reference(table, slot, isRequired);
    int count = at == 0 ? 0 : length(at, 4);
    if (count != types.length) {
      throw new BadValue("the unions in slot " + slot + " have another number of types");
    }
    List<T> values = new ArrayList<>(count);
    for (int i = 0; i < count; ++i) {
      if (types[i] == 0) {
        throw new BadValue("a union in the vector in slot " + slot + " has no type");
      }
      values.add(codec.read(this, types[i] & 0xff, follow(at + 4 + 4 * i)));
    }
    return List.copyOf(values);
  }

  private int vtableSize(int vtable) {
    return Scalars.uint16(bytes, vtable);
  }

  /** The position of a verified vector of numbers; 0: absent. */
  private int vector(int table, int slot, int elementSize, boolean isRequired) {
    int at = reference(table, slot, isRequired);
    if (at != 0 && length(at, elementSize) != 0) {
      check(at + 4, elementSize, elementSize);
    }
    return at;
  }

  /** The number of elements of a verified vector. */
  private int count(int vector) {
    return vector == 0 ? 0 : bytes.getInt(vector);
  }

  /** The number of elements of the vector at a position, which then are within bounds. */
  private int length(int at, int elementSize) {
    check(at, 4, 4);
    long count = Scalars.uint32(bytes, at);
    if (count > (size - at - 4) / elementSize) {
      throw new BadValue("the vector at " + at + " is longer than the message");
    }
    charge(4 + count * elementSize);
    return (int) count;
  }

  /** The position that the offset at a position leads to. */
  private int follow(int at) {
    check(at, 4, 4);
    long target = at + Scalars.uint32(bytes, at);
    if (target == at || target >= size) {
      throw new BadValue("the offset at " + at + " leads out of bounds");
    }
    return (int) target;
  }

  private void check(int at, int byteCount, int alignment) {
    if (at > size - byteCount) {
      throw new BadValue(byteCount + " bytes at " + at + " are out of bounds");
    }
    if (at % alignment != 0) {
      throw new BadValue("position " + at + " is no multiple of " + alignment);
    }
  }

  private void charge(long byteCount) {
    bytesLeft -= byteCount;
    if (bytesLeft < 0) {
      throw new BadValue("too many offsets lead to the same bytes");
    }
  }
}

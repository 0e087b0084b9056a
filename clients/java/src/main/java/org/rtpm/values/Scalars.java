package org.rtpm.values;

import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.util.Objects;

/** Numbers in little-endian buffers, for which {@link ByteBuffer} has no method. */
public final class Scalars {
  private Scalars() {}

  /** Reads a byte as 0 to 255. */
  public static int uint8(ByteBuffer bytes, int at) {
    return bytes.get(at) & 0xff;
  }

  /** Reads two bytes as 0 to 65535. */
  public static int uint16(ByteBuffer bytes, int at) {
    return bytes.getShort(at) & 0xffff;
  }

  /** Reads four bytes as 0 to 4294967295. */
  public static long uint32(ByteBuffer bytes, int at) {
    return bytes.getInt(at) & 0xffff_ffffL;
  }

  /**
   * Checks and narrows.
   *
   * @throws BadValue unless the value is -128 to 127
   */
  public static byte int8(int value) {
    return (byte) checked(value, Byte.MIN_VALUE, Byte.MAX_VALUE);
  }

  /**
   * Checks and narrows.
   *
   * @throws BadValue unless the value is 0 to 255
   */
  public static byte uint8(int value) {
    return (byte) checked(value, 0, 0xff);
  }

  /**
   * Checks and narrows.
   *
   * @throws BadValue unless the value is -32768 to 32767
   */
  public static short int16(int value) {
    return (short) checked(value, Short.MIN_VALUE, Short.MAX_VALUE);
  }

  /**
   * Checks and narrows.
   *
   * @throws BadValue unless the value is 0 to 65535
   */
  public static short uint16(int value) {
    return (short) checked(value, 0, 0xffff);
  }

  /**
   * Checks and narrows.
   *
   * @throws BadValue unless the value is 0 to 4294967295
   */
  public static int uint32(long value) {
    return (int) checked(value, 0, 0xffff_ffffL);
  }

  /** Reads an integer of 1, 2, 4 or 8 bytes. */
  public static long integer(ByteBuffer bytes, int at, int size, boolean isSigned) {
    return switch (size) {
      case 1 -> isSigned ? bytes.get(at) : uint8(bytes, at);
      case 2 -> isSigned ? bytes.getShort(at) : uint16(bytes, at);
      case 4 -> isSigned ? bytes.getInt(at) : uint32(bytes, at);
      default -> bytes.getLong(at);
    };
  }

  /**
   * Writes an integer of 1, 2, 4 or 8 bytes.
   *
   * @throws BadValue if they cannot hold it
   */
  public static void integer(ByteBuffer bytes, int at, int size, boolean isSigned, long value) {
    if (size == 8) {
      bytes.putLong(at, value);
      return;
    }
    long count = 1L << (8 * size);
    long low = isSigned ? -count / 2 : 0;
    long narrow = checked(value, low, low + count - 1);
    switch (size) {
      case 1 -> bytes.put(at, (byte) narrow);
      case 2 -> bytes.putShort(at, (short) narrow);
      default -> bytes.putInt(at, (int) narrow);
    }
  }

  /** The real number nearest to an unsigned one of 64 bits. */
  public static double real(long unsigned) {
    return unsigned >= 0 ? unsigned : (unsigned >>> 1 | unsigned & 1) * 2.0;
  }

  /** Checks the place of a struct's view. */
  public static void view(ByteBuffer bytes, int at, int size) {
    Objects.checkFromIndexSize(at, size, bytes.limit());
    if (bytes.order() != ByteOrder.LITTLE_ENDIAN) {
      throw new IllegalArgumentException(
          "the buffer is big-endian: set its order to LITTLE_ENDIAN");
    }
  }

  /** Checks the index of an array in a struct. */
  public static int index(int index, int count) {
    return Objects.checkIndex(index, count);
  }

  /**
   * Checks an array of a struct.
   *
   * @throws BadValue unless it has so many elements
   */
  public static void count(int actual, int expected) {
    if (actual != expected) {
      throw new BadValue("an array has " + actual + " elements, not " + expected);
    }
  }

  /**
   * Checks a range of a request.
   *
   * @param name the field's place, such as "x"
   * @throws BadValue for a number outside it, or NaN
   */
  public static void range(String name, double value, double low, double high, String limits) {
    if (!(value >= low && value <= high)) {
      throw new BadValue(name + " is " + value + ", but must be " + limits);
    }
  }

  private static long checked(long value, long low, long high) {
    if (value < low || value > high) {
      throw new BadValue(value + " is not within " + low + " to " + high);
    }
    return value;
  }
}

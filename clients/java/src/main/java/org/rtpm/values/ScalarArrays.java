package org.rtpm.values;

import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.util.List;
import java.util.function.IntFunction;
import java.util.stream.IntStream;

/**
 * Arrays of numbers in little-endian buffers, for generated code. The functions that write an array
 * of a struct take its number of elements.
 */
public final class ScalarArrays {
  private ScalarArrays() {}

  /** A list of {@code count} elements by their index. */
  public static <T> List<T> list(int count, IntFunction<T> element) {
    return IntStream.range(0, count).mapToObj(element).toList();
  }

  /** Reads an array. */
  public static boolean[] bools(ByteBuffer bytes, int at, int count) {
    boolean[] values = new boolean[count];
    for (int i = 0; i < count; ++i) {
      values[i] = bytes.get(at + i) != 0;
    }
    return values;
  }

  /** Reads an array of signed or unsigned bytes. */
  public static byte[] bytes(ByteBuffer bytes, int at, int count) {
    byte[] values = new byte[count];
    bytes.get(at, values);
    return values;
  }

  /** Reads an array. */
  public static short[] int16s(ByteBuffer bytes, int at, int count) {
    short[] values = new short[count];
    part(bytes, at, 2 * count).asShortBuffer().get(values);
    return values;
  }

  /** Reads an array of unsigned numbers. */
  public static int[] uint16s(ByteBuffer bytes, int at, int count) {
    int[] values = new int[count];
    for (int i = 0; i < count; ++i) {
      values[i] = Scalars.uint16(bytes, at + 2 * i);
    }
    return values;
  }

  /** Reads an array. */
  public static int[] int32s(ByteBuffer bytes, int at, int count) {
    int[] values = new int[count];
    part(bytes, at, 4 * count).asIntBuffer().get(values);
    return values;
  }

  /** Reads an array of unsigned numbers. */
  public static long[] uint32s(ByteBuffer bytes, int at, int count) {
    long[] values = new long[count];
    for (int i = 0; i < count; ++i) {
      values[i] = Scalars.uint32(bytes, at + 4 * i);
    }
    return values;
  }

  /** Reads an array; the bits of unsigned numbers, too. */
  public static long[] int64s(ByteBuffer bytes, int at, int count) {
    long[] values = new long[count];
    part(bytes, at, 8 * count).asLongBuffer().get(values);
    return values;
  }

  /** Reads an array. */
  public static float[] float32s(ByteBuffer bytes, int at, int count) {
    float[] values = new float[count];
    part(bytes, at, 4 * count).asFloatBuffer().get(values);
    return values;
  }

  /** Reads an array. */
  public static double[] float64s(ByteBuffer bytes, int at, int count) {
    double[] values = new double[count];
    part(bytes, at, 8 * count).asDoubleBuffer().get(values);
    return values;
  }

  /**
   * Writes an array.
   *
   * @throws BadValue unless it has so many elements
   */
  public static void bools(ByteBuffer bytes, int at, int count, boolean[] values) {
    Scalars.count(values.length, count);
    for (int i = 0; i < count; ++i) {
      bytes.put(at + i, (byte) (values[i] ? 1 : 0));
    }
  }

  /** As {@link #bools(ByteBuffer, int, int, boolean[])}. */
  public static void bytes(ByteBuffer bytes, int at, int count, byte[] values) {
    Scalars.count(values.length, count);
    bytes.put(at, values);
  }

  /** As {@link #bools(ByteBuffer, int, int, boolean[])}. */
  public static void int16s(ByteBuffer bytes, int at, int count, short[] values) {
    Scalars.count(values.length, count);
    part(bytes, at, 2 * count).asShortBuffer().put(values);
  }

  /** As {@link #bools(ByteBuffer, int, int, boolean[])}; refuses numbers that do not fit, too. */
  public static void uint16s(ByteBuffer bytes, int at, int count, int[] values) {
    Scalars.count(values.length, count);
    for (int i = 0; i < count; ++i) {
      bytes.putShort(at + 2 * i, Scalars.uint16(values[i]));
    }
  }

  /** As {@link #bools(ByteBuffer, int, int, boolean[])}. */
  public static void int32s(ByteBuffer bytes, int at, int count, int[] values) {
    Scalars.count(values.length, count);
    part(bytes, at, 4 * count).asIntBuffer().put(values);
  }

  /** As {@link #uint16s(ByteBuffer, int, int, int[])}. */
  public static void uint32s(ByteBuffer bytes, int at, int count, long[] values) {
    Scalars.count(values.length, count);
    for (int i = 0; i < count; ++i) {
      bytes.putInt(at + 4 * i, Scalars.uint32(values[i]));
    }
  }

  /** As {@link #bools(ByteBuffer, int, int, boolean[])}. */
  public static void int64s(ByteBuffer bytes, int at, int count, long[] values) {
    Scalars.count(values.length, count);
    part(bytes, at, 8 * count).asLongBuffer().put(values);
  }

  /** As {@link #bools(ByteBuffer, int, int, boolean[])}. */
  public static void float32s(ByteBuffer bytes, int at, int count, float[] values) {
    Scalars.count(values.length, count);
    part(bytes, at, 4 * count).asFloatBuffer().put(values);
  }

  /** As {@link #bools(ByteBuffer, int, int, boolean[])}. */
  public static void float64s(ByteBuffer bytes, int at, int count, double[] values) {
    Scalars.count(values.length, count);
    part(bytes, at, 8 * count).asDoubleBuffer().put(values);
  }

  private static ByteBuffer part(ByteBuffer bytes, int at, int byteCount) {
    return bytes.slice(at, byteCount).order(ByteOrder.LITTLE_ENDIAN);
  }
}

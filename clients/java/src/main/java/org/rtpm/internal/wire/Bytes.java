package org.rtpm.internal.wire;

import java.lang.invoke.MethodHandles;
import java.lang.invoke.VarHandle;
import java.nio.ByteOrder;
import java.util.Arrays;

/** Little-endian numbers in byte arrays. */
public final class Bytes {
  private Bytes() {}

  public static final byte[] NONE = new byte[0];

  private static final VarHandle SHORT =
      MethodHandles.byteArrayViewVarHandle(short[].class, ByteOrder.LITTLE_ENDIAN);
  private static final VarHandle INT =
      MethodHandles.byteArrayViewVarHandle(int[].class, ByteOrder.LITTLE_ENDIAN);
  private static final VarHandle LONG =
      MethodHandles.byteArrayViewVarHandle(long[].class, ByteOrder.LITTLE_ENDIAN);

  public static int u8(byte[] from, int at) {
    return from[at] & 0xff;
  }

  public static int u16(byte[] from, int at) {
    return (short) SHORT.get(from, at) & 0xffff;
  }

  public static int i32(byte[] from, int at) {
    return (int) INT.get(from, at);
  }

  public static long i64(byte[] from, int at) {
    return (long) LONG.get(from, at);
  }

  public static void put16(byte[] to, int at, int value) {
    SHORT.set(to, at, (short) value);
  }

  public static void put32(byte[] to, int at, int value) {
    INT.set(to, at, value);
  }

  public static void put64(byte[] to, int at, long value) {
    LONG.set(to, at, value);
  }

  /** Whether the bytes from {@code begin} to before {@code end} are all zero. */
  public static boolean areZero(byte[] from, int begin, int end) {
    for (int i = begin; i < end; ++i) {
      if (from[i] != 0) {
        return false;
      }
    }
    return true;
  }

  /** The payload behind a frame's header. */
  static byte[] payloadOf(byte[] frame) {
    return frame.length == Limits.HEADER_SIZE
        ? NONE
        : Arrays.copyOfRange(frame, Limits.HEADER_SIZE, frame.length);
  }
}

package org.rtpm.internal.wire;

import java.util.Arrays;

/** The payload of HELLO (hp-4.1). */
public record Hello(
    int versionMin,
    int versionMax,
    int features,
    long clientEpoch,
    long channel,
    long clockDomain,
    int messageSizeMax,
    byte[] cookie) {
  public static final int SIZE = 64;
  public static final int COOKIE_SIZE = 16;

  /** Reads a payload; null if it is malformed (hp-4.1-1). */
  public static Hello read(byte[] payload) {
    if (payload.length != SIZE
        || !Bytes.areZero(payload, 36, 40)
        || !Bytes.areZero(payload, 56, 64)
        || Bytes.i64(payload, 8) == 0) {
      return null;
    }
    return new Hello(
        Bytes.u16(payload, 0),
        Bytes.u16(payload, 2),
        Bytes.i32(payload, 4),
        Bytes.i64(payload, 8),
        Bytes.i64(payload, 16),
        Bytes.i64(payload, 24),
        Bytes.i32(payload, 32),
        Arrays.copyOfRange(payload, 40, 56));
  }

  public byte[] payload() {
    byte[] to = new byte[SIZE];
    Bytes.put16(to, 0, versionMin);
    Bytes.put16(to, 2, versionMax);
    Bytes.put32(to, 4, features);
    Bytes.put64(to, 8, clientEpoch);
    Bytes.put64(to, 16, channel);
    Bytes.put64(to, 24, clockDomain);
    Bytes.put32(to, 32, messageSizeMax);
    System.arraycopy(cookie, 0, to, 40, COOKIE_SIZE);
    return to;
  }

  boolean hasCookie() {
    return !Bytes.areZero(cookie, 0, COOKIE_SIZE);
  }
}

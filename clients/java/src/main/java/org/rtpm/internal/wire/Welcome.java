package org.rtpm.internal.wire;

/** The payload of WELCOME (hp-4.3). */
public record Welcome(
    int bandLow,
    int bandHigh,
    int ceiling,
    int features,
    int window,
    long serverEpoch,
    long clockDomain,
    int messageSizeMax) {
  public static final int SIZE = 48;

  /**
   * Reads a payload; null if it is malformed (hp-4.3-1), but for what depends on the HELLO's
   * priority and on the header's session.
   *
   * @param features the bits that the client offered
   */
  public static Welcome read(byte[] payload, int features) {
    if (payload.length != SIZE
        || Bytes.u16(payload, 0) != Limits.VERSION
        || !Bytes.areZero(payload, 14, 16)
        || !Bytes.areZero(payload, 36, 48)) {
      return null;
    }
    Welcome read =
        new Welcome(
            Bytes.u16(payload, 2),
            Bytes.u16(payload, 4),
            Bytes.u16(payload, 6),
            Bytes.i32(payload, 8),
            Bytes.u16(payload, 12),
            Bytes.i64(payload, 16),
            Bytes.i64(payload, 24),
            Bytes.i32(payload, 32));
    boolean isGood =
        read.bandHigh <= Limits.PRIORITY_MAX
            && read.bandLow <= read.bandHigh
            && read.ceiling <= Limits.PRIORITY_MAX
            && (read.features & ~features) == 0
            && Integer.bitCount(read.window) == 1
            && read.serverEpoch != 0
            && read.messageSizeMax >= Limits.MESSAGE_SIZE_FLOOR
            && read.messageSizeMax <= Limits.MESSAGE_SIZE_CEILING;
    return isGood ? read : null;
  }

  public byte[] payload() {
    byte[] to = new byte[SIZE];
    Bytes.put16(to, 0, Limits.VERSION);
    Bytes.put16(to, 2, bandLow);
    Bytes.put16(to, 4, bandHigh);
    Bytes.put16(to, 6, ceiling);
    Bytes.put32(to, 8, features);
    Bytes.put16(to, 12, window);
    Bytes.put64(to, 16, serverEpoch);
    Bytes.put64(to, 24, clockDomain);
    Bytes.put32(to, 32, messageSizeMax);
    return to;
  }

  public boolean serves(int priority) {
    return bandLow <= priority && priority <= bandHigh;
  }
}

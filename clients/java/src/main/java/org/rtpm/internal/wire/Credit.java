package org.rtpm.internal.wire;

/**
 * The payload of CREDIT (hp-5.10).
 *
 * @param firstMissing all frames before it are there
 * @param byteLimit so many payload bytes may come in all
 * @param later bit i: frame firstMissing + 1 + i is there
 */
public record Credit(int firstMissing, int byteLimit, long later) {
  public static final int SIZE = 16;

  /** Reads a payload; null if it is malformed (hp-5.10-8). */
  public static Credit read(byte[] payload) {
    return payload.length == SIZE
        ? new Credit(Bytes.i32(payload, 0), Bytes.i32(payload, 4), Bytes.i64(payload, 8))
        : null;
  }

  public byte[] payload() {
    byte[] to = new byte[SIZE];
    Bytes.put32(to, 0, firstMissing);
    Bytes.put32(to, 4, byteLimit);
    Bytes.put64(to, 8, later);
    return to;
  }
}

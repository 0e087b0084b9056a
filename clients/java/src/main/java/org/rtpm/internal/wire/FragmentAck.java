package org.rtpm.internal.wire;

import java.util.Arrays;

/**
 * The payload of ACK (hp-5.6).
 *
 * @param firstMissing the first fragment that is not there; the count of fragments if none is
 * @param later 32 bytes; bit i: fragment firstMissing + 1 + i is there
 */
public record FragmentAck(int firstMissing, byte[] later) {
  public static final int SIZE = 40;
  static final int LATER_COUNT = 256;

  /** Reads a payload; null if it is malformed. */
  public static FragmentAck read(byte[] payload) {
    return payload.length == SIZE && Bytes.areZero(payload, 2, 8)
        ? new FragmentAck(Bytes.u16(payload, 0), Arrays.copyOfRange(payload, 8, SIZE))
        : null;
  }

  /** That all fragments before {@code firstMissing}, and none behind it, are there. */
  static FragmentAck upTo(int firstMissing) {
    return new FragmentAck(firstMissing, new byte[LATER_COUNT / 8]);
  }

  public byte[] payload() {
    byte[] to = new byte[SIZE];
    Bytes.put16(to, 0, firstMissing);
    System.arraycopy(later, 0, to, 8, later.length);
    return to;
  }

  boolean hasLater(int i) {
    return (later[i / 8] >> (i % 8) & 1) != 0;
  }
}

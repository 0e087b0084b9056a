package org.rtpm.internal.wire;

import java.util.LinkedHashMap;
import java.util.Map;

/**
 * The reply of a bind with status ok (hp-6.1).
 *
 * @param methods the fingerprint of each method by its number
 */
public record BindReply(
    int service,
    int priority,
    boolean isServerDeclared,
    boolean isMethodListComplete,
    long fingerprint,
    Map<Integer, Integer> methods) {
  private static final int SIZE = 24;
  private static final int ENTRY_SIZE = 8;
  private static final int SERVER_DECLARED = 1;
  private static final int LIST_COMPLETE = 2;

  /** Reads a payload; null if it is malformed (hp-6.1-5). */
  public static BindReply read(byte[] payload) {
    if (payload.length < SIZE) {
      return null;
    }
    int count = Bytes.u16(payload, 16);
    int flags = Bytes.u8(payload, 6);
    boolean isGood =
        payload.length == SIZE + count * ENTRY_SIZE
            && Bytes.i32(payload, 0) != Limits.SESSION_SERVICE
            && Bytes.u16(payload, 4) <= Limits.PRIORITY_MAX
            && (flags & ~(SERVER_DECLARED | LIST_COMPLETE)) == 0
            && payload[7] == 0
            && Bytes.areZero(payload, 18, SIZE);
    if (!isGood) {
      return null;
    }
    Map<Integer, Integer> methods = new LinkedHashMap<>();
    for (int at = SIZE; at < payload.length; at += ENTRY_SIZE) {
      if (Bytes.u16(payload, at + 2) != 0) {
        return null;
      }
      methods.put(Bytes.u16(payload, at), Bytes.i32(payload, at + 4));
    }
    return new BindReply(
        Bytes.i32(payload, 0),
        Bytes.u16(payload, 4),
        (flags & SERVER_DECLARED) != 0,
        (flags & LIST_COMPLETE) != 0,
        Bytes.i64(payload, 8),
        methods);
  }

  public byte[] payload() {
    byte[] to = new byte[SIZE + methods.size() * ENTRY_SIZE];
    Bytes.put32(to, 0, service);
    Bytes.put16(to, 4, priority);
    to[6] =
        (byte)
            ((isServerDeclared ? SERVER_DECLARED : 0) | (isMethodListComplete ? LIST_COMPLETE : 0));
    Bytes.put64(to, 8, fingerprint);
    Bytes.put16(to, 16, methods.size());
    int at = SIZE;
    for (Map.Entry<Integer, Integer> method : methods.entrySet()) {
      Bytes.put16(to, at, method.getKey());
      Bytes.put32(to, at + 4, method.getValue());
      at += ENTRY_SIZE;
    }
    return to;
  }
}

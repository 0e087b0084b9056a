package org.rtpm;

import java.util.ArrayList;
import java.util.Arrays;
import java.util.List;
import org.rtpm.internal.wire.Bytes;

/** Events as bytes (spec/events.md, section 2). */
final class EventBytes {
  private static final int HEADER_SIZE = 64;
  private static final int ALIGNMENT = 16;
  private static final int REPLAYED = 1;
  private static final int JOINED = 2;
  private static final int PRIORITY_MAX = 32767;
  /** How many hubs an event of this program may cross. */
  private static final int HOPS = 8;

  private EventBytes() {}

  /** The events that were read, and whether the bytes behind it are malformed (ev-2-1). */
  record Read(List<Event> events, boolean isBroken) {}

  static Read read(byte[] bytes) {
    List<Event> events = new ArrayList<>();
    int at = 0;
    while (at < bytes.length) {
      if (bytes.length - at < HEADER_SIZE) {
        return new Read(events, true);
      }
      int size = Bytes.i32(bytes, at + 48);
      int flags = bytes[at + 59];
      boolean isGood =
          Bytes.i32(bytes, at) != 0
              && Bytes.u16(bytes, at + 56) <= PRIORITY_MAX
              && (flags & ~(REPLAYED | JOINED)) == 0
              && size >= 0
              && size <= bytes.length - at - HEADER_SIZE;
      if (!isGood) {
        return new Read(events, true);
      }
      int end = at + HEADER_SIZE + size;
      events.add(
          new Event(
              Bytes.i32(bytes, at),
              Bytes.i32(bytes, at + 4),
              Bytes.i64(bytes, at + 8),
              Bytes.i64(bytes, at + 16),
              Bytes.i64(bytes, at + 24),
              Bytes.i64(bytes, at + 32),
              Bytes.i64(bytes, at + 40),
              Integer.toUnsignedLong(Bytes.i32(bytes, at + 52)),
              Bytes.u16(bytes, at + 56),
              (flags & REPLAYED) != 0,
              (flags & JOINED) != 0,
              Arrays.copyOfRange(bytes, at + HEADER_SIZE, end)));
      at = end + padding(size);
    }
    return new Read(events, false);
  }

  /** One event of a supplier. */
  static byte[] write(
      int type,
      int source,
      long sequence,
      long originNs,
      long uncertaintyNs,
      long schemaId,
      byte[] payload) {
    byte[] to = new byte[HEADER_SIZE + payload.length + padding(payload.length)];
    Bytes.put32(to, 0, type);
    Bytes.put32(to, 4, source);
    Bytes.put64(to, 8, sequence);
    Bytes.put64(to, 16, originNs);
    Bytes.put64(to, 40, schemaId);
    Bytes.put32(to, 48, payload.length);
    Bytes.put32(to, 52, (int) Math.min(uncertaintyNs, 0xffff_ffffL));
    to[58] = HOPS;
    System.arraycopy(payload, 0, to, HEADER_SIZE, payload.length);
    return to;
  }

  private static int padding(int size) {
    return (ALIGNMENT - size % ALIGNMENT) % ALIGNMENT;
  }
}

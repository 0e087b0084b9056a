package org.rtpm.internal.sealed;

import java.nio.charset.StandardCharsets;
import java.util.Arrays;
import org.rtpm.internal.wire.Bytes;
import org.rtpm.internal.wire.DropReason;
import org.rtpm.internal.wire.Header;
import org.rtpm.internal.wire.Hello;
import org.rtpm.internal.wire.Limits;
import org.rtpm.internal.wire.Medium;
import org.rtpm.internal.wire.Welcome;

/** The bytes of sealed sessions: their frames, and the payloads of their handshakes. */
public final class Sealing {
  /** Bits of the features in HELLO and WELCOME (sec-3-2). */
  static final int FEATURE_SEALED = 1;
  static final int FEATURE_AES_GCM = 2;

  /** Counter and tag behind a sealed frame's payload. */
  public static final int TRAILER_SIZE = 24;

  static final int COOKIE_SIZE = 56;
  static final int HELLO_SIZE = Hello.SIZE + Noise.MESSAGE_1_SIZE;
  static final int WELCOME_INNER_SIZE = 64;
  private static final int AT_FLAGS = 6;
  private static final byte[] PROLOGUE = "H-Protocol 1.0 S".getBytes(StandardCharsets.US_ASCII);

  private Sealing() {}

  /** The largest payload of a sealed frame (sec-4-3). */
  public static int payloadSizeMax(Medium medium) {
    return medium.payloadSizeMax - TRAILER_SIZE;
  }

  /** Whether the frame has a whole header, and is marked as sealed. */
  public static boolean isSealed(byte[] frame) {
    return frame.length >= Limits.HEADER_SIZE
        && (Bytes.u16(frame, AT_FLAGS) & Header.SEALED) != 0;
  }

  static void mark(byte[] frame) {
    Bytes.put16(frame, AT_FLAGS, Bytes.u16(frame, AT_FLAGS) | Header.SEALED);
  }

  /** Turns the header into that of an ordinary frame. */
  public static void unmark(byte[] frame) {
    Bytes.put16(frame, AT_FLAGS, Bytes.u16(frame, AT_FLAGS) & ~Header.SEALED);
  }

  /** Reads the header of a whole sealed frame (sec-4-2). Nothing in it is authentic yet. */
  public static DropReason readFrame(Header header, byte[] frame, Medium medium) {
    byte[] plain = Arrays.copyOf(frame, Limits.HEADER_SIZE);
    unmark(plain);
    DropReason fault = header.read(plain, plain.length);
    if (fault != null) {
      return fault;
    }
    // sec-4-1
    switch (header.kind) {
      case HELLO, COOKIE, WELCOME -> {
        return DropReason.RESERVED_SET;
      }
      default -> {
        boolean isGood =
            header.payloadSize == frame.length - Limits.HEADER_SIZE - TRAILER_SIZE
                && header.payloadSize <= payloadSizeMax(medium);
        return isGood ? null : DropReason.BAD_LENGTH;
      }
    }
  }

  /** The payload of a sealed server's COOKIE (sec-3.1). */
  public record Cookie(byte[] cookie, byte[] serverKey, int suites) {
    /** Reads a payload; null if it is malformed. */
    public static Cookie read(byte[] payload) {
      return payload.length == COOKIE_SIZE && Bytes.areZero(payload, 52, COOKIE_SIZE)
          ? new Cookie(
              Arrays.copyOf(payload, 16),
              Arrays.copyOfRange(payload, 16, 48),
              Bytes.i32(payload, 48))
          : null;
    }

    public byte[] payload() {
      byte[] to = new byte[COOKIE_SIZE];
      System.arraycopy(cookie, 0, to, 0, 16);
      System.arraycopy(serverKey, 0, to, 16, 32);
      Bytes.put32(to, 48, suites);
      return to;
    }
  }

  /** Reads a HELLO with message 1 (sec-3.2-1); null if it is malformed. */
  public static Hello readHello(byte[] payload) {
    if (payload.length != HELLO_SIZE) {
      return null;
    }
    Hello hello = Hello.read(Arrays.copyOf(payload, Hello.SIZE));
    boolean isGood =
        hello != null
            && (hello.features() & FEATURE_SEALED) != 0
            && (hello.features() & ~(FEATURE_SEALED | FEATURE_AES_GCM)) == 0;
    return isGood ? hello : null;
  }

  /**
   * The sealed part of a WELCOME (sec-3.3).
   *
   * @param former what became of the former session: one of the constants here
   */
  public record Granted(long session, Welcome welcome, int former) {
    static final int NONE = 0;
    static final int ALIVE = 1;
    static final int GONE = 2;
    static final int ENDED = 3;

    /**
     * Reads the bytes; null if they are malformed.
     *
     * @param features those of the client's HELLO
     */
    public static Granted read(byte[] inner, int features) {
      if (inner.length != WELCOME_INNER_SIZE
          || inner[56] < NONE
          || inner[56] > ENDED
          || !Bytes.areZero(inner, 57, WELCOME_INNER_SIZE)) {
        return null;
      }
      Welcome welcome = Welcome.read(Arrays.copyOfRange(inner, 8, 56), features);
      long session = Bytes.i64(inner, 0);
      return welcome == null || welcome.features() != features || session == 0
          ? null
          : new Granted(session, welcome, inner[56]);
    }

    public byte[] bytes() {
      byte[] to = new byte[WELCOME_INNER_SIZE];
      Bytes.put64(to, 0, session);
      System.arraycopy(welcome.payload(), 0, to, 8, Welcome.SIZE);
      to[56] = (byte) former;
      return to;
    }
  }

  /**
   * The bytes that both sides hash first (sec-3.4-1).
   *
   * @param header of the HELLO with message 1
   * @param payload of that HELLO; its first 64 bytes count
   * @param cookie the payload of the COOKIE that it answers; null if there was none
   */
  public static byte[] prologue(Header header, byte[] payload, byte[] cookie) {
    byte[] to = new byte[PROLOGUE.length + 6 + Hello.SIZE + COOKIE_SIZE];
    System.arraycopy(PROLOGUE, 0, to, 0, PROLOGUE.length);
    Bytes.put16(to, 16, header.priority);
    Bytes.put32(to, 18, header.callId);
    System.arraycopy(payload, 0, to, 22, Hello.SIZE);
    if (cookie != null) {
      System.arraycopy(cookie, 0, to, 22 + Hello.SIZE, COOKIE_SIZE);
    }
    return to;
  }
}

package org.rtpm.internal.wire;

/** The numbers of the protocol (spec/hprotocol.md, section 9). Times are in nanoseconds. */
public final class Limits {
  private Limits() {}

  public static final long MICROSECOND = 1_000;
  public static final long MILLISECOND = 1_000_000;
  public static final long SECOND = 1_000_000_000;
  /** Later than every time. */
  public static final long NEVER = Long.MAX_VALUE;

  public static final int VERSION = 1;
  public static final int HEADER_SIZE = 64;
  public static final int DATAGRAM_FRAME_SIZE_MAX = 1408;
  public static final int DATAGRAM_PAYLOAD_SIZE_MAX = DATAGRAM_FRAME_SIZE_MAX - HEADER_SIZE;
  public static final int STREAM_FRAME_SIZE_MAX = 64 * 1024;
  public static final int STREAM_PAYLOAD_SIZE_MAX = STREAM_FRAME_SIZE_MAX - HEADER_SIZE;
  public static final int MESSAGE_SIZE_FLOOR = 1024;
  public static final int MESSAGE_SIZE_CEILING = 16 * 1024 * 1024;
  public static final int PRIORITY_MAX = 32767;

  /** How many calls of a session may be open: the server keeps so many replies. */
  public static final int CALL_WINDOW = 8;
  public static final int FRAGMENT_COUNT_MAX = 12_544;
  /** How long an incomplete large message may be silent before it may be evicted (hp-5.6-10). */
  public static final long LARGE_MESSAGE_SILENCE_MAX = 3 * SECOND;

  /** How many datagrams outside sessions are answered at once for one host (hp-4.4-5). */
  public static final int STRANGER_ANSWER_BURST = 256;
  public static final long STRANGER_ANSWER_INTERVAL = 2 * MILLISECOND;

  /** How many frames of a stream may be unacknowledged, and items granted at a time. */
  public static final int STREAM_WINDOW = 32;
  /** The most frames of a stream that a client keeps. */
  public static final int STREAM_FRAME_COUNT_MAX = 80;
  /** How long a stream's client keeps asking without an answer. */
  public static final long STREAM_SILENCE = 3 * SECOND;
  /** For how long a client asks its server to keep a stream that it does not hear of. */
  public static final long STREAM_LEASE = 10 * SECOND;
  public static final long STREAM_LEASE_MAX = 30 * SECOND;
  /** A budget that means as long as the connection lasts. */
  public static final int BUDGET_UNLIMITED = 0xffff_ffff;
  public static final long STREAM_ASK_INTERVAL_MAX = 500 * MILLISECOND;
  /** On a connection, which loses nothing, the earliest question after an item. */
  public static final long STREAM_ASK_INTERVAL_CONNECTED = 100 * MILLISECOND;

  /** A session may be replaced only after this silence (hp-5.5-1). */
  public static final long SESSION_IDLE_MIN = 30 * SECOND;
  /** A cookie is valid for one to two spans. */
  public static final long COOKIE_SPAN = 10 * SECOND;

  public static final long RETRANSMIT_INTERVAL_FIRST = 5 * MILLISECOND;
  public static final long RETRANSMIT_INTERVAL_MIN = 500 * MICROSECOND;
  /** The shortest wait to a server on the own host, where no datagram is lost on the way. */
  public static final long RETRANSMIT_INTERVAL_ON_HOST = 30 * MILLISECOND;
  public static final long RETRANSMIT_INTERVAL_MAX = SECOND;

  public static final int PATH_SIZE_MAX = 200;
  /** The most bytes of text with which a server refuses a call (hp-7-1). */
  public static final int REFUSAL_TEXT_SIZE_MAX = 200;

  /** The service number of the session itself, and its methods. */
  public static final int SESSION_SERVICE = 0;
  public static final int METHOD_BIND = 1;
  public static final int METHOD_PING = 2;
  public static final int METHOD_DESCRIBE = 3;

  public static final int DEFAULT_PORT = 7420;

  /** One host's quota of a shared resource: three quarters, rounded up. */
  public static int shareOfOneHost(int count) {
    return count - count / 4;
  }
}

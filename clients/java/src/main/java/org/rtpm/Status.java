package org.rtpm;

import java.util.Locale;

/**
 * The outcome of a call, as its server states it (spec/hprotocol.md, section 7).
 *
 * <p>The numbers are the wire's and never change.
 */
public enum Status {
  /** The method ran; the payload is its result. */
  OK(0, true),
  /** Not run: a queue or table is full. Send less, or later. */
  OVERLOAD(1, false),
  /** Not run: the time budget was over before the method began. */
  EXPIRED(2, false),
  /** Not run: the object has no method of that number. */
  NO_SUCH_METHOD(3, false),
  /** Not run: no object has that path or number. */
  NO_SUCH_OBJECT(4, false),
  /** Not run: the payload is not what the method takes. */
  BAD_REQUEST(5, false),
  /** Not run: another client holds the lease that the method needs. */
  NOT_LEASE_HOLDER(6, false),
  /** Not run: the object was removed from its server. */
  GONE(7, false),
  /** The method ran and ended with a fault of its own. */
  SERVANT_FAILED(8, true),
  /** A message or an item exceeds the session's limit. In a reply the method may have run. */
  TOO_LARGE(9, true),
  /** Not run: the priority is above the session's ceiling. */
  PRIORITY_NOT_ALLOWED(10, false),
  /** Not run: the priority is outside the session's or the object's bands. */
  WRONG_BAND(11, false),
  /** The server does not know the session (any more). */
  UNKNOWN_SESSION(12, false),
  /** Handshake refused: no version of the protocol in common. */
  VERSION_UNSUPPORTED(13, false),
  /** Handshake refused: a limit in it is out of range. */
  BAD_LIMITS(14, false),
  /** Bind refused: the object has another interface. */
  WRONG_INTERFACE(15, false),
  /** The method ended early because its caller gave up. It may have run. */
  CANCELLED(16, true),
  /** The server stops. The call may have run. */
  STOPPING(17, true),
  /** The stream ended because its server did not hear its client. It may have run. */
  LOST(18, true),
  /** Not run: the caller's identity may not do this. */
  NOT_ALLOWED(19, false),
  /** A number that this version does not know. The call may have run (hp-5.1-7). */
  UNKNOWN(-1, true);

  private static final Status[] BY_NUMBER = byNumber();

  private final int number;
  private final boolean mayHaveRun;

  Status(int number, boolean mayHaveRun) {
    this.number = number;
    this.mayHaveRun = mayHaveRun;
  }

  private static Status[] byNumber() {
    Status[] all = new Status[values().length - 1];
    for (Status status : values()) {
      if (status.number >= 0) {
        all[status.number] = status;
      }
    }
    return all;
  }

  /** Returns the status with this number on the wire; {@link #UNKNOWN} if there is none. */
  public static Status of(int number) {
    return number >= 0 && number < BY_NUMBER.length ? BY_NUMBER[number] : UNKNOWN;
  }

  /** The number on the wire; -1 for {@link #UNKNOWN}. */
  public int number() {
    return number;
  }

  /** Whether a call that ended with this status may have run. */
  public boolean mayHaveRun() {
    return mayHaveRun;
  }

  /** The name in the specification, such as {@code no_such_object}. */
  @Override
  public String toString() {
    return name().toLowerCase(Locale.ROOT);
  }
}

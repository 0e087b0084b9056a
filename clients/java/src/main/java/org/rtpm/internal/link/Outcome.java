package org.rtpm.internal.link;

import org.rtpm.Status;
import org.rtpm.internal.wire.Bytes;

/**
 * How a call ended.
 *
 * @param status what the server answered; null if the cause is another
 * @param payload of the answer
 * @param mayHaveRun whether the method may have run
 */
public record Outcome(Cause cause, Status status, byte[] payload, boolean mayHaveRun) {
  /** Why a call is over. */
  public enum Cause {
    /** The server answered. */
    REPLIED,
    /** The caller's deadline passed. */
    DEADLINE,
    /** The server lost the session, or its connection ended. */
    LOST,
    /** The server closed the session. */
    CLOSED,
    /** No session could be opened. */
    UNREACHABLE,
    /** The server refused a session, with the status. */
    REFUSED,
    /** The request is larger than the server takes, or than one frame where it has to fit one. */
    TOO_LARGE,
    /** More calls wait than the client keeps. */
    OVERLOAD,
    /** The object is another interface, or one that this client does not understand. */
    NOT_UNDERSTOOD,
    /** The caller cancelled it, or closed the node. */
    CANCELLED
  }

  static Outcome replied(Status status, byte[] payload) {
    return new Outcome(Cause.REPLIED, status, payload, status.mayHaveRun());
  }

  static Outcome failed(Cause cause, boolean mayHaveRun) {
    return new Outcome(cause, null, Bytes.NONE, mayHaveRun);
  }

  /** Whether the payload is the method's result. */
  public boolean isOk() {
    return status == Status.OK;
  }
}

package org.rtpm;

import java.util.Optional;

/** A call failed. The message names the object, the method and the reason. */
public final class CallException extends RtpmException {
  private static final long serialVersionUID = 1L;

  private final Status status;
  private final String text;

  CallException(String message, Status status, String text, WasRun wasRun) {
    super(message, wasRun, null);
    this.status = status;
    this.text = text;
  }

  /**
   * The server's answer, or TOO_LARGE if this program itself refused to send or take the message;
   * empty if there was no answer.
   */
  public Optional<Status> status() {
    return Optional.ofNullable(status);
  }

  /**
   * The server's own words about a request that it refused, such as "force.x is 30, but must be -20
   * to 20 newton"; may be empty. Foreign text, escaped for printing.
   */
  public String text() {
    return text;
  }
}

package org.rtpm;

import java.util.Objects;

/** Thrown by a servant's method to end the call with a status other than servant_failed. */
public final class Refusal extends RuntimeException {
  private static final long serialVersionUID = 1L;

  private final Status status;

  /**
   * Creates a refusal.
   *
   * @param status not ok; that the method did not run is the servant's promise
   * @param text for people, at most 200 bytes of it are sent; sent with bad_request and
   *     servant_failed only
   */
  public Refusal(Status status, String text) {
    super(Objects.requireNonNull(text), null, false, false);
    if (status == Status.OK || status == Status.UNKNOWN) {
      throw new IllegalArgumentException(status + " refuses nothing");
    }
    this.status = status;
  }

  /** The status that the caller gets. */
  public Status status() {
    return status;
  }
}

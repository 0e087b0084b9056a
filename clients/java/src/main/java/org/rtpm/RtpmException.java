package org.rtpm;

/** A call or a bind that failed. */
public abstract class RtpmException extends RuntimeException {
  private static final long serialVersionUID = 1L;

  private final WasRun wasRun;

  RtpmException(String message, WasRun wasRun, Throwable cause) {
    super(message, cause);
    this.wasRun = wasRun;
  }

  /** Whether the method ran. */
  public WasRun wasRun() {
    return wasRun;
  }
}

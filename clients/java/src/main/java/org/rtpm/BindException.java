package org.rtpm;

/** An object could not be bound. The message says why, and what to do. */
public final class BindException extends RtpmException {
  private static final long serialVersionUID = 1L;

  BindException(String message, Throwable cause) {
    super(message, WasRun.NO, cause);
  }
}

package org.rtpm;

import rtpm.names.OutcomeCode;

/** A registry refused a name. The message says why, and what to do. */
public final class NameException extends RuntimeException {
  private static final long serialVersionUID = 1L;

  private final transient OutcomeCode outcome;

  NameException(String message, OutcomeCode outcome) {
    super(message);
    this.outcome = outcome;
  }

  /** The registry's outcome, such as {@link OutcomeCode#NOT_FOUND}. */
  public OutcomeCode outcome() {
    return outcome;
  }
}

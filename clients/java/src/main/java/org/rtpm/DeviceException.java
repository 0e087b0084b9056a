package org.rtpm;

import rtpm.device.OutcomeCode;

/** A device refused what was asked. It did nothing of it. */
public final class DeviceException extends RuntimeException {
  private static final long serialVersionUID = 1L;

  private final transient OutcomeCode outcome;

  DeviceException(String message, OutcomeCode outcome) {
    super(message);
    this.outcome = outcome;
  }

  /** The device's outcome, such as {@link OutcomeCode#NOT_HOLDER}. */
  public OutcomeCode outcome() {
    return outcome;
  }
}

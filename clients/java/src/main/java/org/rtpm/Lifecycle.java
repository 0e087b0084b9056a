package org.rtpm;

/** The state of a device, as {@link rtpm.device.Sample#lifecycle} numbers it. */
public enum Lifecycle {
  /** Not set up: no samples. */
  UNCONFIGURED,
  /** Set up, no force. */
  INACTIVE,
  /** Samples every cycle; force on command. */
  ACTIVE,
  /** No answer: no force; the server tries again. */
  FAULT,
  /** Stopped for good. */
  FINALIZED,
  /** A number that this version does not know. */
  UNKNOWN;

  /** The state with this number. */
  public static Lifecycle of(int number) {
    return number >= 0 && number < UNKNOWN.ordinal() ? values()[number] : UNKNOWN;
  }
}

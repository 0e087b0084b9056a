package org.rtpm;

/** Whether the method of a failed call ran: decides whether the call may be repeated. */
public enum WasRun {
  /** It did not, and will not. */
  NO,
  /** It ran. */
  YES,
  /** It may have run: do not repeat the call unless a second run does no harm. */
  MAYBE
}

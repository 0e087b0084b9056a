package org.rtpm;

import java.time.Duration;

/**
 * A single call states these in place of the defaults.
 *
 * @param priority 0 to 32767; -1 for the object's
 * @param deadline relative to the call; null for the method's, or the node's
 */
public record CallOptions(int priority, Duration deadline) {
  /** Nothing stated. */
  public static final CallOptions DEFAULT = new CallOptions(-1, null);

  /** Checks the components. */
  public CallOptions {
    if (priority < -1 || priority > 32767) {
      throw new IllegalArgumentException("priority " + priority + " is not 0 to 32767");
    }
    if (deadline != null && (deadline.isNegative() || deadline.isZero())) {
      throw new IllegalArgumentException("deadline " + deadline + " is not positive");
    }
  }

  /** These options with another priority. */
  public CallOptions withPriority(int priority) {
    return new CallOptions(priority, deadline);
  }

  /** These options with another deadline. */
  public CallOptions withDeadline(Duration deadline) {
    return new CallOptions(priority, deadline);
  }
}

package org.rtpm.internal.serve;

import org.rtpm.values.CallContext;

/** Which call a thread serves, so that the calls that it makes inherit priority and deadline. */
public final class ServantThread {
  private static final ThreadLocal<CallContext> CURRENT = new ThreadLocal<>();

  private ServantThread() {}

  /** The call that this thread serves; null if it serves none. */
  public static CallContext current() {
    return CURRENT.get();
  }

  static void enter(CallContext call) {
    CURRENT.set(call);
  }

  static void leave() {
    CURRENT.remove();
  }
}

package org.rtpm.internal.wire;

/** Decides when a call is repeated: after the round trip's interval, doubled with each copy. */
final class RetransmitTimer {
  private final RoundTrip path;
  private long current;
  private long sent;
  private long due = Limits.NEVER;
  private int repeatCount;
  private boolean isMeasured = true;

  RetransmitTimer(RoundTrip path) {
    this.path = path;
  }

  /** The call is sent for the first time. */
  void begin(long now) {
    sent = now;
    repeatCount = 0;
    isMeasured = true;
    current = path.firstInterval();
    due = now + current;
  }

  /** The call is sent again; copies are at most 1 s apart (hp-5.3-3). */
  void repeat(long now) {
    ++repeatCount;
    current = Math.min(2 * current, Limits.RETRANSMIT_INTERVAL_MAX);
    due = now + current;
  }

  /** A part of the answer came: restarts the wait. The call is not measured then. */
  void progress(long now) {
    waitFor(now, path.interval());
  }

  /** Sets the next repetition; later waits double from there. */
  void waitFor(long now, long nanoseconds) {
    isMeasured = false;
    current = nanoseconds;
    due = now + nanoseconds;
  }

  /** The answer came. A repeated call is not measured (Karn). */
  void end(long now) {
    due = Limits.NEVER;
    long took = Math.max(now - sent, 1);
    path.backOff(repeatCount > 0 ? Math.min(current, took + took / 4) : 0);
    if (repeatCount == 0 && isMeasured) {
      path.add(took);
    }
  }

  long due() {
    return due;
  }

  long current() {
    return current;
  }

  int repeatCount() {
    return repeatCount;
  }
}

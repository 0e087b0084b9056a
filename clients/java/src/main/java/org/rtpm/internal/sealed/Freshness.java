package org.rtpm.internal.sealed;

import org.rtpm.internal.wire.Limits;

/**
 * How long the frames of a session were held back on their way, without a common clock: each is
 * compared with the fastest one before it (sec-6.1).
 */
final class Freshness {
  static final long TOLERANCE = Limits.MILLISECOND;
  /** 200 ppm: how far two clocks drift apart. */
  private static final long DRIFT_DIVISOR = 5000;
  private static final long STILL_CLOCK = 10 * Limits.SECOND;

  private boolean hasFrame;
  /** Arrival minus the sender's time, modulo 2^64. */
  private long fastest;
  private long fastestAt;
  private long inTimeAt;

  /** Takes an authentic frame in; returns by how much it came later than the fastest one. */
  long take(long senderTime, long now) {
    long sample = now - senderTime;
    long late = sample - (fastest + (now - fastestAt) / DRIFT_DIVISOR);
    if (!hasFrame || late <= 0) {
      hasFrame = true;
      fastest = sample;
      fastestAt = now;
      late = 0;
    }
    if (late <= TOLERANCE) {
      inTimeAt = now;
    }
    return late;
  }

  /** Whether no frame was in time for long: the sender's clock stood still (sec-6.1-2). */
  boolean hasStillClock(long now) {
    return now - inTimeAt >= STILL_CLOCK;
  }
}

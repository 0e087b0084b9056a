package org.rtpm.internal.wire;

/**
 * Estimates the peer's clock from calls, each of which is a probe (hp-5.7). For each of the last 16
 * seconds with probes the best one is kept; the line through them gives the drift.
 */
final class ClockEstimator {
  private static final double DRIFT_MAX = 200e-6;
  private static final long QUANTUM = Limits.MICROSECOND;
  private static final long SLOPE_SPAN_MIN = 4 * Limits.SECOND;
  private static final int POINT_COUNT_MAX = 16;

  private final long[] times = new long[POINT_COUNT_MAX];
  private final long[] offsets = new long[POINT_COUNT_MAX];
  private final long[] halfTrips = new long[POINT_COUNT_MAX];
  private int count;
  private int newest;

  /** Takes the four times of a call in: its request's two, its reply's two. */
  void add(long requestSent, long requestReceived, long replySent, long replyReceived) {
    long trip = (replyReceived - requestSent) - (replySent - requestReceived);
    if (trip < -QUANTUM || replySent < requestReceived) {
      return;
    }
    long time = requestSent + (replyReceived - requestSent) / 2;
    long offset = ((requestReceived - requestSent) + (replySent - replyReceived)) / 2;
    long halfTrip = Math.max(trip, 0) / 2 + QUANTUM;
    if (count > 0) {
      long allowed =
          halfTrips[newest] + halfTrip + (long) (DRIFT_MAX * (time - times[newest]));
      // More than drift can explain: the peer's host was restarted.
      if (Math.abs(offset - offsets[newest]) > allowed) {
        count = 0;
      }
    }
    boolean isOfNewSecond = count == 0 || time - times[newest] >= Limits.SECOND;
    if (!isOfNewSecond && halfTrip > halfTrips[newest]) {
      return;
    }
    if (isOfNewSecond) {
      newest = count == 0 ? 0 : (newest + 1) % POINT_COUNT_MAX;
      count = Math.min(count + 1, POINT_COUNT_MAX);
    }
    times[newest] = time;
    offsets[newest] = offset;
    halfTrips[newest] = halfTrip;
  }

  /** Returns the peer's clock minus this one, and the bound of the error; null before a probe. */
  PeerClock estimate(long now) {
    PeerClock best = null;
    double drift = slope();
    for (int i = 0; i < count; ++i) {
      double age = now - times[i];
      long uncertainty = halfTrips[i] + (long) (Math.abs(age) * DRIFT_MAX);
      if (best == null || uncertainty < best.uncertaintyNs()) {
        best = new PeerClock(offsets[i] + (long) (age * drift), uncertainty);
      }
    }
    return best;
  }

  // Least squares; 0 while the points span too little.
  private double slope() {
    if (count == 0) {
      return 0;
    }
    double sumX = 0;
    double sumY = 0;
    double sumXx = 0;
    double sumXy = 0;
    long span = 0;
    for (int i = 0; i < count; ++i) {
      double x = times[i] - times[newest];
      double y = offsets[i] - offsets[newest];
      span = Math.max(span, times[newest] - times[i]);
      sumX += x;
      sumY += y;
      sumXx += x * x;
      sumXy += x * y;
    }
    double divisor = count * sumXx - sumX * sumX;
    if (span < SLOPE_SPAN_MIN || divisor <= 0) {
      return 0;
    }
    double slope = (count * sumXy - sumX * sumY) / divisor;
    return Math.max(-DRIFT_MAX, Math.min(DRIFT_MAX, slope));
  }

  /** An estimate of the peer's clock: it is ahead by {@code offsetNs}, give or take. */
  record PeerClock(long offsetNs, long uncertaintyNs) {}
}

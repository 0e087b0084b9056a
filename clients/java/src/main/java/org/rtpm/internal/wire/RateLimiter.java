package org.rtpm.internal.wire;

import java.util.Arrays;

/**
 * Limits an action of each host: {@code burst} times at once, then once per interval. Hosts share
 * 64 places by a secret hash, so that memory does not grow with them.
 */
public final class RateLimiter {
  private static final int PLACE_COUNT = 64;

  private final SipHash key;
  private final long interval;
  private final long tolerance;
  private final long[] fullAt = new long[PLACE_COUNT];

  public RateLimiter(SipHash key, int burst, long interval) {
    this.key = key;
    this.interval = interval;
    tolerance = interval * (burst - 1);
    Arrays.fill(fullAt, Long.MIN_VALUE);
  }

  /** Whether the host may now; counts it if so. */
  public boolean admit(Peer host, long now) {
    int place = (int) (key.hash(host.hostHigh(), host.hostLow()) & PLACE_COUNT - 1);
    long begin = Math.max(fullAt[place], now);
    if (begin - now > tolerance) {
      return false;
    }
    fullAt[place] = begin + interval;
    return true;
  }
}

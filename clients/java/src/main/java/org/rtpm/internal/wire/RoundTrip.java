package org.rtpm.internal.wire;

/** A channel's round trip, measured by its calls: smoothed mean and deviation (hp-5.3-1). */
final class RoundTrip {
  private long intervalMin = Limits.RETRANSMIT_INTERVAL_MIN;
  private long smoothed;
  private long deviation;
  private long backedOff;
  private boolean wasRepeated;

  void setIntervalMin(long nanoseconds) {
    intervalMin = nanoseconds;
  }

  /** How long to wait for an answer. */
  long interval() {
    if (smoothed == 0) {
      return Math.max(Limits.RETRANSMIT_INTERVAL_FIRST, intervalMin);
    }
    return Math.min(
        Math.max(smoothed + 4 * deviation, intervalMin), Limits.RETRANSMIT_INTERVAL_MAX);
  }

  /** How long to wait after the first transmission of a call. */
  long firstInterval() {
    return Math.max(interval(), backedOff);
  }

  /** The smoothed round trip; 0 before the first measurement. */
  long smoothed() {
    return smoothed;
  }

  /** Adds the round trip of a call that was sent once. */
  void add(long measured) {
    long sample = Math.max(measured, 1);
    if (smoothed == 0) {
      smoothed = sample;
      deviation = sample / 2;
      return;
    }
    deviation += (Math.abs(sample - smoothed) - deviation) / 4;
    smoothed = Math.max(smoothed + (sample - smoothed) / 8, 1);
  }

  /**
   * Records the last wait of a repeated call; 0 for a call that was not repeated. After two
   * repeated calls in a row the wait holds for the next call, too: else a round trip that is longer
   * than the wait would never be measured. One repeated call alone shows a loss.
   */
  void backOff(long wait) {
    backedOff = wasRepeated ? wait : 0;
    wasRepeated = wait > 0;
  }
}

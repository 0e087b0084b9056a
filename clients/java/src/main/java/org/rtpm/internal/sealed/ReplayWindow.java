package org.rtpm.internal.sealed;

/** Which counters were received (sec-5-4): the last 1024, in blocks of 64 bits. */
final class ReplayWindow {
  private static final int SIZE = 1024;
  private static final int BLOCK_COUNT = SIZE / 64 + 1;

  private final long[] blocks = new long[BLOCK_COUNT];
  private long next;

  /** The counter after the largest one received. */
  long next() {
    return next;
  }

  boolean isNew(long counter) {
    if (counter >= next) {
      return true;
    }
    return next - counter <= SIZE
        && (blocks[(int) (counter / 64 % BLOCK_COUNT)] >>> (counter % 64) & 1) == 0;
  }

  void add(long counter) {
    if (counter >= next) {
      long newest = counter / 64;
      long before = next == 0 ? 0 : (next - 1) / 64;
      long passed = Math.min(newest - before, BLOCK_COUNT);
      for (long i = 0; i < passed; ++i) {
        blocks[(int) ((newest - i) % BLOCK_COUNT)] = 0;
      }
      next = counter + 1;
    }
    blocks[(int) (counter / 64 % BLOCK_COUNT)] |= 1L << (counter % 64);
  }
}

package org.rtpm.internal.wire;

/** Which fragments of a message are there. */
final class FragmentSet {
  private final long[] words;
  private final int count;
  private int firstMissing;

  FragmentSet(int count) {
    this.count = count;
    words = new long[(count + 63) / 64];
  }

  boolean contains(int index) {
    return (words[index / 64] >>> (index % 64) & 1) != 0;
  }

  /** Returns false if the fragment is in the set already. */
  boolean insert(int index) {
    if (contains(index)) {
      return false;
    }
    words[index / 64] |= 1L << (index % 64);
    while (firstMissing < count && contains(firstMissing)) {
      ++firstMissing;
    }
    return true;
  }

  int firstMissing() {
    return firstMissing;
  }

  int count() {
    return count;
  }

  boolean isComplete() {
    return firstMissing == count;
  }
}

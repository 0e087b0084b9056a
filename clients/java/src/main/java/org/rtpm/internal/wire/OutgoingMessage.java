package org.rtpm.internal.wire;

/**
 * Sends one message as fragments, a window at a time, and repeats those that an ACK shows to be
 * lost. It has no timer: its owner calls {@link #nudge} when no ACK comes.
 */
final class OutgoingMessage {
  private final Header header;
  private final byte[] message;
  private final int fragmentSize;
  private final int window;
  private final FragmentSet acknowledged;
  private int nextNew;
  private int repairNext;
  private int repairEnd;

  OutgoingMessage(Header about, byte[] message, int fragmentSize, int window) {
    this.message = message;
    this.fragmentSize = fragmentSize;
    this.window = window;
    header = about.copy();
    header.fragmentCount = (message.length + fragmentSize - 1) / fragmentSize;
    header.messageSize = message.length;
    acknowledged = new FragmentSet(header.fragmentCount);
  }

  boolean isAcknowledged() {
    return acknowledged.isComplete();
  }

  /** Returns the next frame that may be sent now; null if there is none. */
  byte[] next(int budgetUs, long now) {
    int newBefore = nextNew;
    int index = choose();
    if (index < 0) {
      return null;
    }
    int flags = index < newBefore ? Header.REPEATED : 0;
    // hp-5.6-3: asks often enough to keep the window moving.
    if (!hasMore() || index % (window / 2) == window / 2 - 1) {
      flags |= Header.ACK_WANTED;
    }
    return write(index, flags, budgetUs, now);
  }

  /** The first fragment once more, to learn the state of the call. */
  byte[] firstAgain(int budgetUs, long now) {
    return write(0, Header.REPEATED | Header.ACK_WANTED, budgetUs, now);
  }

  /**
   * Takes the receiver's state in.
   *
   * @param isAsked the receiver heard nothing for a while (hp-5.6-7)
   */
  void onAck(FragmentAck ack, boolean isAsked) {
    // An ACK for fragments that were never sent is forged or faulty.
    if (ack.firstMissing() > nextNew) {
      return;
    }
    int end = ack.firstMissing();
    for (int i = acknowledged.firstMissing(); i < ack.firstMissing(); ++i) {
      acknowledged.insert(i);
    }
    for (int i = 0; i < FragmentAck.LATER_COUNT; ++i) {
      int index = ack.firstMissing() + 1 + i;
      if (index >= nextNew) {
        break;
      }
      if (ack.hasLater(i)) {
        acknowledged.insert(index);
        end = index;
      }
    }
    // hp-5.6-6: a missing fragment before one that is there counts as lost.
    repairNext = acknowledged.firstMissing();
    repairEnd = Math.max(end, repairNext);
    if (isAsked && !hasMore()) {
      nudge();
    }
  }

  /** No ACK came in time: the first fragment that is not acknowledged is due again. */
  void nudge() {
    if (!isAcknowledged()) {
      repairNext = acknowledged.firstMissing();
      repairEnd = Math.min(repairNext + 1, nextNew);
    }
  }

  private boolean hasMore() {
    for (int i = repairNext; i < repairEnd; ++i) {
      if (!acknowledged.contains(i)) {
        return true;
      }
    }
    // hp-5.6-2
    return nextNew < acknowledged.count() && nextNew < acknowledged.firstMissing() + window;
  }

  private int choose() {
    while (repairNext < repairEnd) {
      int index = repairNext++;
      if (!acknowledged.contains(index)) {
        return index;
      }
    }
    return hasMore() ? nextNew++ : -1;
  }

  private byte[] write(int index, int flags, int budgetUs, long now) {
    int at = index * fragmentSize;
    Header part = header.copy();
    part.flags |= flags;
    part.fragmentIndex = index;
    part.payloadSize = Math.min(fragmentSize, message.length - at);
    part.senderTimeNs = now;
    // A CALL's budget shrinks with each fragment; a REPLY's is what the method took.
    if (part.kind == FrameKind.CALL) {
      part.budgetUs = budgetUs;
    }
    return part.frame(message, at);
  }
}

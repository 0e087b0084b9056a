package org.rtpm.internal.wire;

import java.util.Arrays;

/**
 * The server's end of one stream: splits items into numbered frames; over datagrams it keeps them
 * and repeats lost ones (hp-5.10).
 */
final class OutgoingStream {
  private final Header header;
  private final Medium medium;
  private final int fragmentSize;
  private final byte[][] kept = new byte[Limits.STREAM_WINDOW][];
  private int count;
  private int itemCount;
  private int itemLimit;
  private int byteCount;
  private int byteLimit;
  private int firstMissing;
  /** Bit i: frame firstMissing + i is to be repeated. */
  private long repairs;

  /** Begins the stream that the call {@code about} asks for. */
  OutgoingStream(Header about, Medium medium, int fragmentSize) {
    this.medium = medium;
    this.fragmentSize = fragmentSize;
    header = about.about(FrameKind.ITEM, 0, 0);
    itemLimit = about.item;
    byteLimit = medium.streamBytesFirst;
  }

  /** The number of frames sent. */
  int count() {
    return count;
  }

  boolean isAcknowledged() {
    return firstMissing == count;
  }

  /** Whether only a part of an item was pushed. */
  boolean isMidway() {
    return header.fragmentIndex > 0;
  }

  /** Returns the next frame of {@code item}; null if the client takes no more now. */
  byte[] push(byte[] item, long now) {
    // hp-5.10-2
    if (!isMidway() && itemLimit - itemCount <= 0) {
      return null;
    }
    if (isKept() && count - firstMissing >= Limits.STREAM_WINDOW) {
      return null;
    }
    int at = header.fragmentIndex * fragmentSize;
    int size = Math.min(fragmentSize, item.length - at);
    if (byteLimit - byteCount < size) {
      return null;
    }
    if (!isMidway()) {
      header.messageSize = item.length;
      header.fragmentCount = Math.max((item.length + fragmentSize - 1) / fragmentSize, 1);
      header.senderTimeNs = now;
      ++itemCount;
    }
    header.payloadSize = size;
    header.item = count;
    byte[] frame = header.frame(item, at);
    byteCount += size;
    if (isKept()) {
      kept[count & Limits.STREAM_WINDOW - 1] = frame;
    }
    ++count;
    if (++header.fragmentIndex == header.fragmentCount) {
      header.fragmentIndex = 0;
    }
    if (!isKept()) {
      firstMissing = count;
    }
    return frame;
  }

  /**
   * Takes the client's state and its new limits in.
   *
   * @param isAsked the client heard nothing for a while
   */
  void onCredit(Credit credit, int newItemLimit, boolean isAsked) {
    // hp-5.10-8
    if (credit.firstMissing() - count > 0) {
      return;
    }
    if (newItemLimit - itemLimit > 0) {
      itemLimit = newItemLimit;
    }
    if (credit.byteLimit() - byteLimit > 0) {
      byteLimit = credit.byteLimit();
    }
    if (!isKept() || credit.firstMissing() - firstMissing < 0) {
      return;
    }
    firstMissing = credit.firstMissing();
    if (isAcknowledged()) {
      Arrays.fill(kept, null);
    }
    int sent = count - firstMissing;
    // hp-5.10-4: a missing frame before one that is there is lost; so is the first missing one if
    // the client heard nothing for long.
    int known = 64 - Long.numberOfLeadingZeros(credit.later());
    int lostEnd = Math.min(known, sent);
    long beforeKnown = lostEnd == 0 ? 0 : -1L >>> (64 - lostEnd);
    repairs = beforeKnown & ~(credit.later() << 1);
    if (isAsked && sent > 0) {
      repairs |= 1;
    }
  }

  /** Returns the next frame to repeat; null if none is known to be lost. */
  byte[] next() {
    if (repairs == 0) {
      return null;
    }
    int number = firstMissing + Long.numberOfTrailingZeros(repairs);
    repairs &= repairs - 1;
    return Header.markRepeated(kept[number & Limits.STREAM_WINDOW - 1].clone());
  }

  private boolean isKept() {
    return medium == Medium.DATAGRAM;
  }
}

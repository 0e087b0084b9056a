package org.rtpm.internal.wire;

/**
 * The client's end of one stream: orders the frames and puts items together. A frame is kept until
 * its item is taken, or until it is copied to where a larger item is put together (hp-5.10).
 */
final class IncomingStream {
  enum Taken {
    NEW,
    /** An earlier frame is missing. */
    AHEAD,
    DUPLICATE,
    /** Not granted, too large, or no part of the current item. */
    FOREIGN
  }

  private static final class Part {
    byte[] payload = Bytes.NONE;
    int messageSize;
    /** 0 if the frame is a whole item. */
    int fragmentSize;
    int index;
    int count = 1;
  }

  private enum View {
    NONE,
    FRAME,
    ITEM
  }

  private final Part[] parts;
  private final int window;
  private final int byteWindow;
  private final int itemSizeMax;
  /** The first frame that is still kept, and its slot. */
  private int freed;
  private int freedSlot;
  private int firstMissing;
  /** Bit i: frame firstMissing + 1 + i is there. */
  private long present;
  private int end;
  private boolean isEnded;
  /** The next expected part of the current item; null between items. */
  private Part atHand;
  private int atHandIndex;
  private int readyCount;
  private int itemCount;
  private int droppedCount;
  private int keptBytes;
  private int freedBytes;
  private byte[] item;
  private int filled;
  private boolean isWhole;
  private View view = View.NONE;

  /**
   * Begins a stream.
   *
   * @param window items taken at a time, 1 to 32
   * @param byteWindow payload bytes taken at a time
   * @param itemSizeMax the largest item, as HELLO stated
   */
  IncomingStream(Medium medium, int window, int byteWindow, int itemSizeMax) {
    // hp-5.10-11: fragments are no smaller than this.
    int least = medium == Medium.DATAGRAM ? Limits.MESSAGE_SIZE_FLOOR : 16_320;
    parts = new Part[Math.min(window + (byteWindow + least - 1) / least,
        Limits.STREAM_FRAME_COUNT_MAX)];
    this.window = window;
    this.byteWindow = byteWindow;
    this.itemSizeMax = itemSizeMax;
  }

  /** Takes a frame in. One that was ahead and does not fit is dropped when its turn comes. */
  Taken take(Header header, byte[] payload) {
    int number = header.item;
    int distance = number - firstMissing;
    if (distance < 0) {
      return Taken.DUPLICATE;
    }
    if (distance > 64 || Integer.compareUnsigned(number - freed, parts.length) >= 0) {
      return Taken.FOREIGN;
    }
    if (isEnded && number - end >= 0) {
      return Taken.FOREIGN;
    }
    long bit = distance == 0 ? 0 : 1L << (distance - 1);
    if ((present & bit) != 0) {
      return Taken.DUPLICATE;
    }
    Part part = new Part();
    part.payload = payload;
    part.messageSize = header.messageSize;
    part.fragmentSize = header.fragmentCount > 1 ? header.fragmentSize() : 0;
    part.index = header.fragmentIndex;
    part.count = header.fragmentCount;
    // hp-5.10-9: frames beyond the granted bytes are not kept.
    if (keptBytes + payload.length > byteWindow || (distance == 0 && !fits(part))) {
      return Taken.FOREIGN;
    }
    parts[slotOf(number)] = part;
    keptBytes += payload.length;
    present |= bit;
    if (distance > 0) {
      return Taken.AHEAD;
    }
    accept(part);
    acceptLaterOnes();
    putTogether();
    return Taken.NEW;
  }

  /** Takes the server's final count of frames; false if it contradicts the frames that came. */
  boolean end(int count) {
    if (isEnded) {
      return count == end;
    }
    if (count - knownEnd() < 0 || Integer.compareUnsigned(count - freed, parts.length) > 0) {
      return false;
    }
    isEnded = true;
    end = count;
    return true;
  }

  /** Returns the next item in order; null if it is not complete yet. */
  byte[] next() {
    if (view != View.NONE) {
      if (view == View.FRAME) {
        freeFirst();
      } else {
        item = null;
        filled = 0;
        isWhole = false;
      }
      view = View.NONE;
      ++itemCount;
      putTogether();
    }
    if (!hasNext()) {
      return null;
    }
    --readyCount;
    if (isWhole) {
      view = View.ITEM;
      return item;
    }
    view = View.FRAME;
    return parts[freedSlot].payload;
  }

  boolean hasNext() {
    return readyCount > 0;
  }

  Credit credit() {
    return new Credit(firstMissing, freedBytes + byteWindow, present);
  }

  /** Items below this number are taken. */
  int limit() {
    return itemCount + window;
  }

  int droppedCount() {
    return droppedCount;
  }

  /** The number of frames released. */
  int freedCount() {
    return freed;
  }

  int byteWindow() {
    return byteWindow;
  }

  /** Whether the frame would be the first one behind a missing one. */
  boolean revealsGap(int number) {
    return number - knownEnd() > 0;
  }

  /** Whether fragments of the current item are missing. */
  boolean isMidway() {
    return atHandIndex > 0;
  }

  boolean isEnded() {
    return isEnded;
  }

  boolean isComplete() {
    return isEnded && firstMissing == end;
  }

  private int knownEnd() {
    return present == 0
        ? firstMissing
        : firstMissing + 65 - Long.numberOfLeadingZeros(present);
  }

  // Not the number modulo the slots, which would jump when the numbers wrap around.
  private int slotOf(int number) {
    return (freedSlot + (number - freed)) % parts.length;
  }

  private boolean fits(Part part) {
    if (!isMidway()) {
      return part.index == 0 && part.messageSize <= itemSizeMax;
    }
    return part.index == atHandIndex
        && part.count == atHand.count
        && part.messageSize == atHand.messageSize
        && part.fragmentSize == atHand.fragmentSize;
  }

  private void accept(Part part) {
    ++firstMissing;
    atHand = part;
    atHandIndex = part.index + 1;
    if (atHandIndex == part.count) {
      atHand = null;
      atHandIndex = 0;
      ++readyCount;
    }
  }

  private void acceptLaterOnes() {
    while (true) {
      boolean isThere = (present & 1) != 0;
      present >>>= 1;
      if (!isThere) {
        return;
      }
      Part later = parts[slotOf(firstMissing)];
      if (!fits(later)) {
        keptBytes -= later.payload.length;
        ++droppedCount;
        return;
      }
      accept(later);
    }
  }

  private void freeFirst() {
    int size = parts[freedSlot].payload.length;
    parts[freedSlot] = null;
    keptBytes -= size;
    freedBytes += size;
    freedSlot = (freedSlot + 1) % parts.length;
    ++freed;
  }

  // Moving a fragment frees its place for further ones. Waits while the reader has an item.
  private void putTogether() {
    while (!isWhole && view == View.NONE && freed != firstMissing) {
      Part part = parts[freedSlot];
      if (part.count == 1) {
        return;
      }
      if (part.index == 0) {
        item = new byte[part.messageSize];
      }
      System.arraycopy(part.payload, 0, item, filled, part.payload.length);
      filled += part.payload.length;
      isWhole = part.index + 1 == part.count;
      freeFirst();
    }
  }
}

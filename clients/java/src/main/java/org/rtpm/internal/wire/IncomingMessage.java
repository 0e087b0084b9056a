package org.rtpm.internal.wire;

/** Puts one message together from its fragments, which come in any order and repeatedly. */
final class IncomingMessage {
  enum Taken {
    NEW,
    DUPLICATE,
    LAST,
    /** The fragment belongs to another message (hp-5.6-9). */
    FOREIGN
  }

  private static final int FLAGS_OF_THE_MESSAGE = Header.NO_REPLY | Header.REPLY_ON_RECEIPT;

  private final Header first;
  private final int fragmentSize;
  private final byte[] message;
  private final FragmentSet arrived;

  /** Begins the message that {@code header}, of any of its fragments, describes. */
  IncomingMessage(Header header) {
    first = header.copy();
    fragmentSize = header.fragmentSize();
    message = new byte[header.messageSize];
    arrived = new FragmentSet(header.fragmentCount);
  }

  Taken take(Header header, byte[] payload) {
    if (header.messageSize != message.length
        || header.fragmentCount != arrived.count()
        || header.fragmentSize() != fragmentSize
        || header.service != first.service
        || header.method != first.method
        || header.priority != first.priority
        || header.item != first.item
        || ((header.flags ^ first.flags) & FLAGS_OF_THE_MESSAGE) != 0) {
      return Taken.FOREIGN;
    }
    if (!arrived.insert(header.fragmentIndex)) {
      return Taken.DUPLICATE;
    }
    System.arraycopy(payload, 0, message, header.fragmentIndex * fragmentSize, payload.length);
    return arrived.isComplete() ? Taken.LAST : Taken.NEW;
  }

  byte[] message() {
    return message;
  }

  FragmentAck ack() {
    FragmentAck ack = FragmentAck.upTo(arrived.firstMissing());
    for (int i = 0; i < FragmentAck.LATER_COUNT; ++i) {
      int index = ack.firstMissing() + 1 + i;
      if (index >= arrived.count()) {
        break;
      }
      if (arrived.contains(index)) {
        ack.later()[i / 8] |= (byte) (1 << (i % 8));
      }
    }
    return ack;
  }
}

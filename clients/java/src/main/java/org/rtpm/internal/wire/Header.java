package org.rtpm.internal.wire;

import org.rtpm.Status;

/**
 * The 64 bytes at the beginning of every frame (hp-2).
 *
 * <p>Unsigned 32-bit numbers are held in ints and compared modulo 2^32.
 */
public final class Header {
  public static final int REPEATED = 1;
  public static final int ACK_WANTED = 2;
  public static final int NO_REPLY = 4;
  public static final int REPLY_ON_RECEIPT = 8;
  /** Marks frames of sealed sessions; elsewhere it is reserved. */
  public static final int SEALED = 16;

  private static final int FLAGS_KNOWN = REPEATED | ACK_WANTED | NO_REPLY | REPLY_ON_RECEIPT;
  private static final int ONEWAY = NO_REPLY | REPLY_ON_RECEIPT;
  private static final int MAGIC = 0x5048;
  static final int AT_PRIORITY = 4;
  static final int AT_FLAGS = 6;
  static final int AT_PAYLOAD_SIZE = 28;

  public FrameKind kind = FrameKind.CALL;
  public int priority;
  public int flags;
  public long session;
  public int callId;
  public int service;
  public int method;
  /** The number on the wire; see {@link #status()}. */
  public int statusNumber;
  public int payloadSize;
  public int fragmentIndex;
  public int fragmentCount = 1;
  public int messageSize;
  public int budgetUs;
  public int item;
  public long senderTimeNs;
  public long traceId;

  public Status status() {
    return Status.of(statusNumber);
  }

  public boolean has(int flag) {
    return (flags & flag) != 0;
  }

  /** A copy, so that a later frame does not change it. */
  Header copy() {
    Header to = about(kind, payloadSize, senderTimeNs);
    to.flags = flags;
    to.statusNumber = statusNumber;
    to.fragmentIndex = fragmentIndex;
    to.fragmentCount = fragmentCount;
    to.messageSize = messageSize;
    to.budgetUs = budgetUs;
    to.item = item;
    return to;
  }

  /** The header of an unfragmented frame that refers to this one's call. */
  public Header about(FrameKind newKind, int newPayloadSize, long now) {
    Header to = new Header();
    to.kind = newKind;
    to.priority = priority;
    to.session = session;
    to.callId = callId;
    to.service = service;
    to.method = method;
    to.payloadSize = newPayloadSize;
    to.messageSize = newPayloadSize;
    to.senderTimeNs = now;
    to.traceId = traceId;
    return to;
  }

  /** Writes the header to the first bytes of {@code to}. */
  public void write(byte[] to) {
    Bytes.put16(to, 0, MAGIC);
    to[2] = Limits.VERSION;
    to[3] = (byte) kind.number();
    Bytes.put16(to, AT_PRIORITY, priority);
    Bytes.put16(to, AT_FLAGS, flags);
    Bytes.put64(to, 8, session);
    Bytes.put32(to, 16, callId);
    Bytes.put32(to, 20, service);
    Bytes.put16(to, 24, method);
    Bytes.put16(to, 26, statusNumber);
    Bytes.put32(to, AT_PAYLOAD_SIZE, payloadSize);
    Bytes.put16(to, 32, fragmentIndex);
    Bytes.put16(to, 34, fragmentCount);
    Bytes.put32(to, 36, messageSize);
    Bytes.put32(to, 40, budgetUs);
    Bytes.put32(to, 44, item);
    Bytes.put64(to, 48, senderTimeNs);
    Bytes.put64(to, 56, traceId);
  }

  /** Returns a frame of this header and the part of {@code from} that payloadSize says. */
  public byte[] frame(byte[] from, int at) {
    byte[] frame = new byte[Limits.HEADER_SIZE + payloadSize];
    write(frame);
    System.arraycopy(from, at, frame, Limits.HEADER_SIZE, payloadSize);
    return frame;
  }

  /**
   * Reads and checks the header at the beginning of {@code bytes}, which may be anything. Does not
   * check that payloadSize bytes follow.
   *
   * <p>hp-2-1: the order of the checks is the specification's, so that every implementation counts
   * a frame with several faults alike.
   *
   * @param length how many of the bytes count
   * @return why the frame is to be dropped; null if it is good
   */
  public DropReason read(byte[] bytes, int length) {
    if (length < Limits.HEADER_SIZE) {
      return DropReason.TOO_SHORT;
    }
    if (Bytes.u16(bytes, 0) != MAGIC) {
      return DropReason.BAD_MAGIC;
    }
    if (bytes[2] != Limits.VERSION) {
      return DropReason.BAD_VERSION;
    }
    kind = FrameKind.of(Bytes.u8(bytes, 3));
    if (kind == null) {
      return DropReason.BAD_KIND;
    }
    priority = Bytes.u16(bytes, AT_PRIORITY);
    if (priority > Limits.PRIORITY_MAX) {
      return DropReason.BAD_PRIORITY;
    }
    flags = Bytes.u16(bytes, AT_FLAGS);
    item = Bytes.i32(bytes, 44);
    if (!hasGoodFlags()) {
      return DropReason.RESERVED_SET;
    }
    session = Bytes.i64(bytes, 8);
    callId = Bytes.i32(bytes, 16);
    service = Bytes.i32(bytes, 20);
    method = Bytes.u16(bytes, 24);
    statusNumber = Bytes.u16(bytes, 26);
    payloadSize = Bytes.i32(bytes, AT_PAYLOAD_SIZE);
    fragmentIndex = Bytes.u16(bytes, 32);
    fragmentCount = Bytes.u16(bytes, 34);
    messageSize = Bytes.i32(bytes, 36);
    budgetUs = Bytes.i32(bytes, 40);
    senderTimeNs = Bytes.i64(bytes, 48);
    traceId = Bytes.i64(bytes, 56);
    if (payloadSize < 0 || payloadSize > Limits.MESSAGE_SIZE_CEILING) {
      return DropReason.BAD_LENGTH;
    }
    return hasGoodFragmentNumbers() ? null : DropReason.BAD_FRAGMENT;
  }

  /** Like {@link #read}, for a whole frame: checks its size, too (hp-2-3, hp-2-6, hp-8-2). */
  public DropReason readFrame(byte[] frame, Medium medium) {
    DropReason fault = read(frame, frame.length);
    if (fault == null
        && (payloadSize != frame.length - Limits.HEADER_SIZE
            || payloadSize > medium.payloadSizeMax)) {
      return DropReason.BAD_LENGTH;
    }
    return fault;
  }

  // hp-2-5
  private boolean hasGoodFlags() {
    if ((flags & ~FLAGS_KNOWN) != 0) {
      return false;
    }
    int oneway = flags & ONEWAY;
    return switch (kind) {
      case CALL -> oneway == 0 || (oneway != ONEWAY && item == 0);
      case REPLY, ACK, ITEM, CREDIT -> oneway == 0;
      default -> oneway == 0 && item == 0;
    };
  }

  // hp-2-4, hp-5.8-2
  private boolean hasGoodFragmentNumbers() {
    if (fragmentCount == 1) {
      return fragmentIndex == 0 && messageSize == payloadSize;
    }
    return (kind == FrameKind.CALL || kind == FrameKind.REPLY || kind == FrameKind.ITEM)
        && !has(NO_REPLY)
        && messageSize >= 0
        && messageSize <= Limits.MESSAGE_SIZE_CEILING
        && fragmentSize() != 0;
  }

  /**
   * The size of all fragments of the message but the last (hp-5.6-1); 0 if the numbers contradict
   * one another or the limits.
   */
  int fragmentSize() {
    if (fragmentCount < 2
        || fragmentCount > Limits.FRAGMENT_COUNT_MAX
        || fragmentIndex >= fragmentCount
        || payloadSize == 0
        || payloadSize >= messageSize) {
      return 0;
    }
    boolean isLast = fragmentIndex == fragmentCount - 1;
    int beforeLast = messageSize - payloadSize;
    if (isLast && beforeLast % (fragmentCount - 1) != 0) {
      return 0;
    }
    int size = isLast ? beforeLast / (fragmentCount - 1) : payloadSize;
    long capacity = (long) size * fragmentCount;
    return capacity >= messageSize && capacity - size < messageSize ? size : 0;
  }

  /** Sets *repeated*, and nothing else, in a written frame. */
  static byte[] markRepeated(byte[] frame) {
    Bytes.put16(frame, AT_FLAGS, REPEATED);
    return frame;
  }
}

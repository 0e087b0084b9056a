package org.rtpm.internal.wire;

/** Datagrams may be lost, duplicated, reordered and forged; a stream has none of these faults. */
public enum Medium {
  DATAGRAM(Limits.DATAGRAM_PAYLOAD_SIZE_MAX, 32, 32 * Limits.DATAGRAM_PAYLOAD_SIZE_MAX),
  STREAM(Limits.STREAM_PAYLOAD_SIZE_MAX, 4, Limits.STREAM_PAYLOAD_SIZE_MAX);

  /** The largest payload of one frame. */
  public final int payloadSizeMax;
  /** How many fragments of a message may be unacknowledged (hp-5.6-2). */
  final int fragmentWindow;
  /** How many bytes of items a server may send before the first CREDIT (hp-5.10-9). */
  final int streamBytesFirst;

  Medium(int payloadSizeMax, int fragmentWindow, int streamBytesFirst) {
    this.payloadSizeMax = payloadSizeMax;
    this.fragmentWindow = fragmentWindow;
    this.streamBytesFirst = streamBytesFirst;
  }
}

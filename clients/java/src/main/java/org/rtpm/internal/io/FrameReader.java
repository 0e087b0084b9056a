package org.rtpm.internal.io;

import java.nio.ByteBuffer;
import org.rtpm.internal.sealed.Sealing;
import org.rtpm.internal.wire.Header;
import org.rtpm.internal.wire.Limits;

/** Cuts the bytes of a connection into frames. One thread. */
public final class FrameReader {
  private final ByteBuffer buffer = ByteBuffer.allocate(2 * Limits.STREAM_FRAME_SIZE_MAX);
  private final Header header = new Header();
  private final boolean takesSealed;
  private boolean isBroken;

  /**
   * Creates a reader.
   *
   * @param takesSealed whether sealed frames may come; else they are as broken as any reserved flag
   */
  public FrameReader(boolean takesSealed) {
    this.takesSealed = takesSealed;
  }

  /** Where received bytes go; {@link #next} takes them from there. */
  public ByteBuffer buffer() {
    return buffer;
  }

  /**
   * Returns the next frame; null if it is not there yet.
   *
   * <p>hp-8-2: after a bad header, or one of a frame that is too large, where the next frame begins
   * is unknown. Then the header alone is returned, which the protocol refuses, and nothing more.
   */
  public byte[] next() {
    if (isBroken || buffer.position() < Limits.HEADER_SIZE) {
      return null;
    }
    byte[] begin = new byte[Limits.HEADER_SIZE];
    buffer.get(0, begin);
    boolean isSealed = takesSealed && Sealing.isSealed(begin);
    byte[] plain = begin.clone();
    if (isSealed) {
      Sealing.unmark(plain);
    }
    int trailer = isSealed ? Sealing.TRAILER_SIZE : 0;
    if (header.read(plain, plain.length) != null
        || header.payloadSize + trailer > Limits.STREAM_FRAME_SIZE_MAX - Limits.HEADER_SIZE) {
      isBroken = true;
      return begin;
    }
    int size = Limits.HEADER_SIZE + header.payloadSize + trailer;
    if (buffer.position() < size) {
      return null;
    }
    byte[] frame = new byte[size];
    buffer.flip();
    buffer.get(frame);
    buffer.compact();
    return frame;
  }
}

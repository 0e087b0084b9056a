package org.rtpm.internal.io;

import java.io.IOException;
import java.nio.ByteBuffer;
import java.nio.channels.SocketChannel;
import java.util.ArrayDeque;
import java.util.Deque;

/** Writes frames to a connection, and keeps what its buffer does not take. One thread at a time. */
final class FrameWriter {
  private final SocketChannel socket;
  private final int keptMax;
  private final Deque<ByteBuffer> kept = new ArrayDeque<>();
  private int keptSize;

  /**
   * Creates a writer.
   *
   * @param keptMax how many bytes it keeps
   */
  FrameWriter(SocketChannel socket, int keptMax) {
    this.socket = socket;
    this.keptMax = keptMax;
  }

  /**
   * Writes a frame, or keeps it.
   *
   * @return false if more would have to be kept than may be: the peer does not read
   */
  boolean write(byte[] frame) throws IOException {
    ByteBuffer bytes = ByteBuffer.wrap(frame);
    if (kept.isEmpty() && socket.isConnected()) {
      socket.write(bytes);
    }
    if (bytes.hasRemaining()) {
      keptSize += bytes.remaining();
      kept.add(bytes);
    }
    return keptSize <= keptMax;
  }

  /** Writes what was kept, as far as it goes. */
  void flush() throws IOException {
    while (!kept.isEmpty()) {
      ByteBuffer next = kept.peek();
      keptSize -= socket.write(next);
      if (next.hasRemaining()) {
        return;
      }
      kept.remove();
    }
  }

  boolean hasKept() {
    return !kept.isEmpty();
  }
}

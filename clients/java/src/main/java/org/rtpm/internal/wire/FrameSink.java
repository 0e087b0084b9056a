package org.rtpm.internal.wire;

/** Takes the frames that one side of the protocol sends. */
@FunctionalInterface
public interface FrameSink {
  /** Sends the frame, which the sink may keep but not change. */
  void send(byte[] frame);
}

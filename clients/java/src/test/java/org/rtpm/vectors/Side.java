package org.rtpm.vectors;

import java.util.List;

/** One side of the protocol behind the words of the conversations' steps. */
interface Side {
  /**
   * Gives a frame to the side.
   *
   * @param isForeign it comes from another address than the client's
   */
  List<Output> receive(byte[] frame, boolean isForeign, long now);

  /** Does what the step says that the side's application does. */
  List<Output> act(Json step, FreeBytes free, long now);
}

package org.rtpm.internal.wire;

/** When a call counts as done for its caller (hp-5.8). */
public enum Delivery {
  /** When the method's result came. */
  REPLY,
  /** When the server is about to run it; the method's result is dropped. */
  RECEIPT,
  /** When it is sent; it may get lost, and fits one frame. */
  SENT
}

package org.rtpm.internal.wire;

/** The kinds of frames; their numbers are the ordinals plus one (hp-3). */
public enum FrameKind {
  HELLO,
  COOKIE,
  WELCOME,
  REFUSE,
  CALL,
  REPLY,
  CLOSE,
  ACK,
  CANCEL,
  ITEM,
  CREDIT;

  private static final FrameKind[] ALL = values();

  /** The number on the wire. */
  public int number() {
    return ordinal() + 1;
  }

  /** Returns the kind of this number; null if there is none. */
  static FrameKind of(int number) {
    return number >= 1 && number <= ALL.length ? ALL[number - 1] : null;
  }
}

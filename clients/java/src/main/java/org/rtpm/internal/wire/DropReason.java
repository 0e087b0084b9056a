package org.rtpm.internal.wire;

import java.util.Locale;

/** Why a frame was dropped; each drop is counted under exactly one reason (hp-8-1). */
public enum DropReason {
  TOO_SHORT,
  BAD_MAGIC,
  BAD_VERSION,
  BAD_KIND,
  RESERVED_SET,
  BAD_PRIORITY,
  BAD_LENGTH,
  BAD_FRAGMENT,
  BAD_PAYLOAD,
  BAD_COOKIE,
  UNKNOWN_SESSION,
  FOREIGN_ADDRESS,
  STALE_CALL,
  DUPLICATE_RUNNING,
  UNEXPECTED,
  RATE_LIMITED,
  UNSEALED,
  BAD_SEAL,
  REPLAYED;

  /** The name in the specification. */
  @Override
  public String toString() {
    return name().toLowerCase(Locale.ROOT);
  }
}

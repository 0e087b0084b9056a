package org.rtpm.internal.wire;

/** Counts the frames that one side of the protocol received and dropped, and what came of calls. */
public final class Counters {
  /** Frames, dropped ones included. */
  public long received;
  /** Repeated calls answered from the kept replies. */
  public long duplicatesAnswered;
  /** Calls not run because their deadline had passed. */
  public long expired;
  /** Calls and sessions refused. */
  public long refused;
  public long sessionsOpened;
  public long sessionsEvicted;
  public long cancelled;
  /** Calls that ended without a peer to answer. */
  public long orphaned;
  public long largeEvicted;
  /** Items of streams, repetitions not counted. */
  public long items;

  private final long[] dropped = new long[DropReason.values().length];

  public void drop(DropReason reason) {
    ++dropped[reason.ordinal()];
  }

  public long dropped(DropReason reason) {
    return dropped[reason.ordinal()];
  }
}

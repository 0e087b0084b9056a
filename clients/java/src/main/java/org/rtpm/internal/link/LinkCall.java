package org.rtpm.internal.link;

import org.rtpm.Status;
import org.rtpm.internal.wire.ClientChannel;
import org.rtpm.internal.wire.Delivery;
import org.rtpm.internal.wire.Limits;

/** A call on its way through a {@link ServerLink}. */
public final class LinkCall {
  /** Hears how the call goes on. Called with the link locked. */
  public interface Handler {
    /** The stream has items: {@link ServerLink#nextItem}. */
    default void onItems() {}

    /** The call is over; items of a stream may be left to take. */
    void onEnd(Outcome outcome);
  }

  /** How often a call that may run twice is sent again after a loss. */
  private static final int REPEAT_COUNT_MAX = 3;

  final LinkObject object;
  final int service;
  final int method;
  int priority;
  long traceId;
  long deadline;
  final Delivery delivery;
  final int streamWindow;
  final boolean isIdempotent;
  final byte[] payload;
  final Handler handler;
  ChannelOfBand channel;
  ClientChannel.Call call;
  boolean wasSent;
  boolean isOver;
  /** The server's epoch when it was sent last. */
  long epoch;
  long begun;
  int repeatCount;
  /** How a reused call ends that goes as usual; null for a call that is made once. */
  private Outcome usual;
  /** The channel that {@link #call} is of. */
  ChannelOfBand callChannel;

  private LinkCall(
      LinkObject object,
      int service,
      int method,
      int priority,
      long traceId,
      long deadline,
      Delivery delivery,
      int streamWindow,
      boolean isIdempotent,
      byte[] payload,
      Handler handler) {
    this.object = object;
    this.service = service;
    this.method = method;
    this.priority = priority;
    this.traceId = traceId;
    this.deadline = deadline;
    this.delivery = delivery;
    this.streamWindow = streamWindow;
    this.isIdempotent = isIdempotent;
    this.payload = payload;
    this.handler = handler;
  }

  /**
   * A call of an object.
   *
   * @param priority -1: the object's
   * @param streamWindow how many items of a stream are taken at a time; 0: it is no stream
   */
  public static LinkCall of(
      LinkObject object,
      int method,
      int priority,
      long traceId,
      long deadline,
      Delivery delivery,
      int streamWindow,
      boolean isIdempotent,
      byte[] payload,
      Handler handler) {
    return new LinkCall(
        object,
        0,
        method,
        priority,
        traceId,
        deadline,
        delivery,
        streamWindow,
        isIdempotent,
        payload,
        handler);
  }

  /**
   * Lets the call be made again and again, one at a time, without garbage.
   *
   * @param replyMemory where a reply of its size goes; other ones come with memory of their own
   */
  public void reuse(byte[] replyMemory) {
    usual = Outcome.replied(Status.OK, replyMemory);
  }

  /** Prepares a reused call that is over for {@link ServerLink#call}. */
  public void renew(int newPriority, long newTraceId, long newDeadline) {
    priority = newPriority;
    traceId = newTraceId;
    deadline = newDeadline;
    channel = null;
    wasSent = false;
    isOver = false;
    repeatCount = 0;
  }

  boolean isReused() {
    return usual != null;
  }

  byte[] replyMemory() {
    return usual.payload();
  }

  Outcome outcome(Status status, byte[] reply) {
    return usual != null && reply == usual.payload() ? usual : Outcome.replied(status, reply);
  }

  /** A call of the session itself. */
  static LinkCall ofSession(
      int method, int priority, long deadline, byte[] payload, Handler handler) {
    return new LinkCall(
        null,
        Limits.SESSION_SERVICE,
        method,
        priority,
        0,
        deadline,
        Delivery.REPLY,
        0,
        true,
        payload,
        handler);
  }

  boolean mayRepeat() {
    return isIdempotent && streamWindow == 0 && repeatCount++ < REPEAT_COUNT_MAX;
  }
}

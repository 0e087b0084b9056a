package org.rtpm.internal.serve;

import java.util.concurrent.Flow;
import org.rtpm.Status;
import org.rtpm.internal.wire.Bytes;
import org.rtpm.internal.wire.ServerSessions;
import org.rtpm.values.Codec;

/**
 * Sends the items of a servant's publisher to the client, one after the other: asks for the next
 * one when the client took the one before.
 */
final class ItemPump<R> implements Flow.Subscriber<R> {
  private final ServedCall call;
  private final Lane lane;
  private final Codec<R> codec;
  // With the lane locked, but for what the publisher calls.
  private Flow.Subscription source;
  private byte[] item;
  private boolean isOver;
  /** Null while the publisher may give more; then the status that ends the stream. */
  private Status ending;

  ItemPump(ServedCall call, Lane lane, Codec<R> codec) {
    this.call = call;
    this.lane = lane;
    this.codec = codec;
  }

  @Override
  public void onSubscribe(Flow.Subscription subscription) {
    boolean isWanted =
        lane.locked(
            () -> {
              if (source != null || isOver) {
                return false;
              }
              source = subscription;
              return true;
            });
    if (isWanted) {
      subscription.request(1);
    } else {
      subscription.cancel();
    }
  }

  @Override
  public void onNext(R value) {
    byte[] bytes;
    try {
      bytes = codec.encode(value);
    } catch (RuntimeException e) {
      onError(e);
      return;
    }
    boolean isTooLarge =
        lane.locked(
            () -> {
              int max = call.sessions.itemSizeMax(call.request);
              if (isOver || max == 0) {
                return false;
              }
              if (bytes.length > max || call.isTooLarge(bytes.length)) {
                return true;
              }
              item = bytes;
              push();
              return false;
            });
    if (isTooLarge) {
      // hp-5.10-10
      end(Status.TOO_LARGE);
    }
  }

  @Override
  public void onError(Throwable fault) {
    endBehindItems(ServedCall.statusOf(fault));
  }

  @Override
  public void onComplete() {
    endBehindItems(Status.OK);
  }

  private void endBehindItems(Status status) {
    boolean isEndDue =
        lane.locked(
            () -> {
              // An item that is not sent yet goes first.
              ending = status;
              return item == null && !isOver;
            });
    if (isEndDue) {
      end(status);
    }
  }

  private void end(Status status) {
    stop();
    call.complete(status, Bytes.NONE);
  }

  private void stop() {
    Flow.Subscription from =
        lane.locked(
            () -> {
              Flow.Subscription open = isOver ? null : source;
              isOver = true;
              item = null;
              return open;
            });
    if (from != null) {
      from.cancel();
    }
  }

  // Sends as much of the item as the client takes now; then asks for the next one.
  private void push() {
    ServerSessions sessions = call.sessions;
    while (item != null && sessions.pushItem(call.request, item, System.nanoTime())) {
      if (!sessions.isItemMidway(call.request)) {
        item = null;
        lane.later(this::next);
      }
    }
  }

  private void next() {
    Flow.Subscription from = lane.locked(() -> isOver || ending != null ? null : source);
    if (from != null) {
      from.request(1);
      return;
    }
    Status due = lane.locked(() -> isOver || item != null ? null : ending);
    if (due != null) {
      end(due);
    }
  }

  /** The client takes more. With the lane locked. */
  void onCredit() {
    push();
  }

  /** The client gave up. With the lane locked. */
  void cancel() {
    item = null;
    lane.later(() -> end(Status.CANCELLED));
  }
}

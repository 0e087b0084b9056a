package org.rtpm.interop;

import java.util.concurrent.BlockingQueue;
import java.util.concurrent.Flow;
import java.util.concurrent.LinkedBlockingQueue;
import java.util.concurrent.TimeUnit;
import org.rtpm.CallException;
import rtpm.interop.Item;

/** Takes the items of a stream on the thread that asks, which may be as slow as it likes. */
final class StreamReader implements Flow.Subscriber<Item> {
  private static final int PATIENCE_SECONDS = 10;
  private static final Object END = "the end";

  private final BlockingQueue<Object> all = new LinkedBlockingQueue<>();
  private final int window;
  private volatile Flow.Subscription source;

  /**
   * A reader.
   *
   * @param window how many items it asks for before it takes one
   */
  StreamReader(int window) {
    this.window = window;
  }

  @Override
  public void onSubscribe(Flow.Subscription subscription) {
    source = subscription;
    subscription.request(window);
  }

  @Override
  public void onNext(Item item) {
    all.add(item);
  }

  @Override
  public void onError(Throwable fault) {
    all.add(fault);
  }

  @Override
  public void onComplete() {
    all.add(END);
  }

  private Object take() throws InterruptedException {
    Object next = all.poll(PATIENCE_SECONDS, TimeUnit.SECONDS);
    if (next == null) {
      throw new IllegalStateException("nothing came for " + PATIENCE_SECONDS + " s");
    }
    return next;
  }

  Item next() throws InterruptedException {
    Object next = take();
    if (next instanceof Item item) {
      source.request(1);
      return item;
    }
    throw next instanceof RuntimeException fault
        ? fault
        : new IllegalStateException("the stream ended too early");
  }

  void expectEnd() throws InterruptedException {
    Object next = take();
    if (next != END) {
      throw new IllegalStateException("no end, but " + next);
    }
  }

  CallException failure() throws InterruptedException {
    Object next = take();
    if (next instanceof CallException failure) {
      return failure;
    }
    throw new IllegalStateException("no failure, but " + next);
  }

  void cancel() {
    source.cancel();
  }
}

package org.rtpm;

import java.util.concurrent.CompletableFuture;
import java.util.concurrent.ExecutionException;
import java.util.concurrent.TimeUnit;
import java.util.concurrent.TimeoutException;
import org.rtpm.internal.io.ClientLoop;

/**
 * The future of a call. It completes on the node's thread, which nothing else could make progress
 * on: so waiting there is an error and not a hang.
 */
final class CallFuture<T> extends CompletableFuture<T> {
  private final ClientLoop loop;
  private final Runnable onCancel;

  CallFuture(ClientLoop loop, Runnable onCancel) {
    this.loop = loop;
    this.onCancel = onCancel;
  }

  @Override
  public <U> CompletableFuture<U> newIncompleteFuture() {
    return new CallFuture<>(loop, () -> {});
  }

  @Override
  public boolean cancel(boolean mayInterrupt) {
    boolean isCancelled = super.cancel(mayInterrupt);
    if (isCancelled) {
      onCancel.run();
    }
    return isCancelled;
  }

  private void checkThread() {
    if (!isDone() && loop.isOwnThread()) {
      throw new IllegalStateException(
          "a call's callback waits for another call, on the thread that would end it: use"
              + " thenCompose, or thenApplyAsync with an executor of your own");
    }
  }

  @Override
  public T get() throws InterruptedException, ExecutionException {
    checkThread();
    return super.get();
  }

  @Override
  public T get(long timeout, TimeUnit unit)
      throws InterruptedException, ExecutionException, TimeoutException {
    checkThread();
    return super.get(timeout, unit);
  }

  @Override
  public T join() {
    checkThread();
    return super.join();
  }
}

package org.rtpm;

import java.util.concurrent.CompletableFuture;
import java.util.concurrent.Flow;
import org.rtpm.values.Method;

/**
 * Calls the methods of one object; a {@code Binding} is one, and generated clients use one.
 *
 * <p>Threads: any, several calls at once.
 */
public interface Caller {
  /**
   * Calls a method of kind CALL, or RECEIPT, whose future ends with null when the server has the
   * request.
   *
   * @return completes exceptionally if the call fails; cancelling it cancels the call
   */
  <Q, R> CompletableFuture<R> call(Method<Q, R> method, Q request, CallOptions options);

  /** Sends a oneway, and returns when the system has it. It may get lost. */
  <Q> void send(Method<Q, ?> oneway, Q request, CallOptions options);

  /**
   * Calls a method of kind STREAM.
   *
   * @return for one subscriber; the call begins when it subscribes, and is cancelled by it
   */
  <Q, R> Flow.Publisher<R> stream(Method<Q, R> method, Q request, CallOptions options);

  /** Calls a method with the default options. */
  default <Q, R> CompletableFuture<R> call(Method<Q, R> method, Q request) {
    return call(method, request, CallOptions.DEFAULT);
  }

  /** Sends a oneway with the default options. */
  default <Q> void send(Method<Q, ?> oneway, Q request) {
    send(oneway, request, CallOptions.DEFAULT);
  }

  /** Opens a stream with the default options. */
  default <Q, R> Flow.Publisher<R> stream(Method<Q, R> method, Q request) {
    return stream(method, request, CallOptions.DEFAULT);
  }
}

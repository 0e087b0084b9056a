package org.rtpm.values;

import java.util.Objects;
import java.util.concurrent.CompletionStage;
import java.util.concurrent.Flow;

/**
 * A method of a {@link Skeleton} with the servant's function behind it.
 *
 * @param <Q> the request's type
 * @param <R> the type of the reply or item
 */
public sealed interface Operation<Q, R> {
  /** The method. */
  Method<Q, R> method();

  /** A function that ends with its reply; also of oneways, whose result is null. */
  record Plain<Q, R>(Method<Q, R> method, Function<Q, R> function) implements Operation<Q, R> {
    /** Checks the components. */
    public Plain {
      Objects.requireNonNull(function);
    }
  }

  /** {@code rtpm_deferred}: a function whose reply may come after it returned. */
  record Deferred<Q, R>(Method<Q, R> method, Function<Q, CompletionStage<R>> function)
      implements Operation<Q, R> {
    /** Checks the components. */
    public Deferred {
      Objects.requireNonNull(function);
    }
  }

  /** {@code rtpm_stream}: the server subscribes once, and asks for items as they are taken. */
  record Stream<Q, R>(Method<Q, R> method, Function<Q, Flow.Publisher<R>> function)
      implements Operation<Q, R> {
    /** Checks the components. */
    public Stream {
      Objects.requireNonNull(function);
    }
  }

  /** The servant's code. An exception ends the call as {@code servant_failed} or as its status. */
  @FunctionalInterface
  interface Function<Q, T> {
    /** Runs the method. */
    T run(Q request, CallContext context) throws Exception;
  }
}

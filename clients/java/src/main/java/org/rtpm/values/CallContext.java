package org.rtpm.values;

import java.time.Duration;
import java.util.Optional;

/**
 * A call as its servant sees it.
 *
 * <p>Threads: any, also after the method returned.
 */
public interface CallContext {
  /** The priority that the method runs at, 0 to 32767. */
  int priority();

  /** The time that the caller still waits; empty if it states no deadline. */
  Optional<Duration> timeLeft();

  /** Whether the caller gave up. The method may end early; its result is dropped. */
  boolean isCancelled();

  /** The caller's trace id, 64 bits; 0 for none. */
  long traceId();
}

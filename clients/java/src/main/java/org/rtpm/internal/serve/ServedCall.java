package org.rtpm.internal.serve;

import java.nio.ByteBuffer;
import java.nio.charset.StandardCharsets;
import java.time.Duration;
import java.util.Arrays;
import java.util.Optional;
import java.util.concurrent.CompletionException;
import java.util.concurrent.CompletionStage;
import java.util.concurrent.Flow;
import org.rtpm.Refusal;
import org.rtpm.Status;
import org.rtpm.internal.wire.Bytes;
import org.rtpm.internal.wire.Limits;
import org.rtpm.internal.wire.ServerSessions;
import org.rtpm.values.BadValue;
import org.rtpm.values.CallContext;
import org.rtpm.values.Method;
import org.rtpm.values.Operation;

/** A call of an object, from when its lane took it in until it is completed. */
final class ServedCall implements CallContext, Comparable<ServedCall> {
  /** Longer budgets count as none. */
  private static final long BUDGET_MAX = 4_000 * Limits.SECOND;

  final ServerSessions sessions;
  final ServerSessions.Request request;
  final long number;
  private final Lane lane;
  private final Operation<?, ?> operation;
  private final int priority;
  private volatile boolean isCancelled;
  private ItemPump<?> items;

  /**
   * A call that waits.
   *
   * @param number rises from call to call: those of one priority run in this order
   */
  ServedCall(
      Lane lane,
      ServerSessions sessions,
      ServerSessions.Request request,
      Operation<?, ?> operation,
      int priority,
      long number) {
    this.lane = lane;
    this.sessions = sessions;
    this.request = request;
    this.operation = operation;
    this.priority = priority;
    this.number = number;
  }

  @Override
  public int compareTo(ServedCall other) {
    int byPriority = Integer.compare(other.priority, priority);
    return byPriority != 0 ? byPriority : Long.compare(number, other.number);
  }

  @Override
  public boolean equals(Object other) {
    return this == other;
  }

  @Override
  public int hashCode() {
    return Long.hashCode(number);
  }

  @Override
  public int priority() {
    return priority;
  }

  @Override
  public Optional<Duration> timeLeft() {
    long left = request.deadline() - System.nanoTime();
    return left > BUDGET_MAX
        ? Optional.empty()
        : Optional.of(Duration.ofNanos(Math.max(left, 0)));
  }

  @Override
  public boolean isCancelled() {
    return isCancelled;
  }

  @Override
  public long traceId() {
    return request.traceId();
  }

  /** Whether the object is there for the caller. */
  boolean maySee(String path) {
    return lane.locked(() -> lane.maySee(sessions, request, path));
  }

  // ---- with the lane locked ---------------------------------------------------------------------

  void cancel() {
    isCancelled = true;
    if (items != null) {
      items.cancel();
    }
  }

  /** Whether the schema allows no reply or item of so many bytes. */
  boolean isTooLarge(int size) {
    return operation.method().isTooLarge(size);
  }

  void onCredit() {
    if (items != null) {
      items.onCredit();
    }
  }

  // ---- on a worker's thread ---------------------------------------------------------------------

  /** Runs the method. Never throws. */
  void run() {
    if (!begin()) {
      return;
    }
    ServantThread.enter(this);
    try {
      dispatch(operation);
    } catch (Exception e) {
      fail(e);
    } catch (StackOverflowError e) {
      // The servant's own fault; the lane goes on.
      complete(Status.SERVANT_FAILED, Bytes.NONE);
    } finally {
      ServantThread.leave();
    }
  }

  // hp-5.4-3, hp-5.9-2, hp-5.8-3
  private boolean begin() {
    return lane.locked(
        () -> {
          long now = System.nanoTime();
          if (isCancelled) {
            sessions.complete(request, Status.CANCELLED, Bytes.NONE, now);
            return false;
          }
          if (request.deadline() <= now && !request.wantsStream()) {
            ++sessions.counters().expired;
            sessions.complete(request, Status.EXPIRED, Bytes.NONE, now);
            return false;
          }
          if (request.wantsReceipt()) {
            sessions.accept(request, Status.OK, now);
          }
          return true;
        });
  }

  private <Q, R> void dispatch(Operation<Q, R> of) throws Exception {
    Method<Q, R> method = of.method();
    Q argument;
    try {
      argument = method.request().decode(ByteBuffer.wrap(request.payload()));
    } catch (BadValue e) {
      complete(Status.BAD_REQUEST, text(e.getMessage()));
      return;
    }
    if (of instanceof Operation.Plain<Q, R> plain) {
      succeed(method, plain.function().run(argument, this));
    } else if (of instanceof Operation.Deferred<Q, R> deferred) {
      CompletionStage<R> later = deferred.function().run(argument, this);
      later.whenComplete((result, fault) -> end(method, result, fault));
    } else if (of instanceof Operation.Stream<Q, R> stream) {
      Flow.Publisher<R> publisher = stream.function().run(argument, this);
      ItemPump<R> pump = new ItemPump<>(this, lane, method.reply());
      lane.locked(
          () -> {
            items = pump;
            if (isCancelled) {
              pump.cancel();
            }
            return null;
          });
      publisher.subscribe(pump);
    }
  }

  private <R> void end(Method<?, R> method, R result, Throwable fault) {
    if (fault != null) {
      fail(fault);
      return;
    }
    try {
      succeed(method, result);
    } catch (RuntimeException e) {
      fail(e);
    }
  }

  private <R> void succeed(Method<?, R> method, R result) {
    boolean hasReply = !request.wantsNoReply() && !request.wantsReceipt();
    complete(Status.OK, hasReply ? method.reply().encode(result) : Bytes.NONE);
  }

  /** Ends the call as its method's exception says. */
  void fail(Throwable fault) {
    Throwable cause = causeOf(fault);
    Status status = statusOf(fault);
    boolean hasText = status == Status.BAD_REQUEST || status == Status.SERVANT_FAILED;
    complete(status, hasText ? text(String.valueOf(cause.getMessage())) : Bytes.NONE);
  }

  /** The status of a method's exception, which is logged unless it is a refusal. */
  static Status statusOf(Throwable fault) {
    Throwable cause = causeOf(fault);
    if (cause instanceof Refusal refusal) {
      return refusal.status();
    }
    System.getLogger("rtpm").log(System.Logger.Level.WARNING, "a servant failed", cause);
    return Status.SERVANT_FAILED;
  }

  private static Throwable causeOf(Throwable fault) {
    return fault instanceof CompletionException && fault.getCause() != null
        ? fault.getCause()
        : fault;
  }

  /** Ends the call, as the limits of the session and the schema allow. */
  void complete(Status status, byte[] payload) {
    lane.locked(
        () -> {
          boolean isTooLarge =
              payload.length > sessions.replySizeMax(request)
                  || (status == Status.OK && isTooLarge(payload.length));
          sessions.complete(
              request,
              isTooLarge ? Status.TOO_LARGE : status,
              isTooLarge ? Bytes.NONE : payload,
              System.nanoTime());
          return null;
        });
  }

  // hp-7-1: at most 200 bytes, and no half of a character.
  private static byte[] text(String reason) {
    byte[] bytes = reason.getBytes(StandardCharsets.UTF_8);
    int size = Math.min(bytes.length, Limits.REFUSAL_TEXT_SIZE_MAX);
    while (size > 0 && size < bytes.length && (bytes[size] & 0xc0) == 0x80) {
      --size;
    }
    return Arrays.copyOf(bytes, size);
  }
}

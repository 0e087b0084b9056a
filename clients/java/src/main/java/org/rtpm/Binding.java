package org.rtpm;

import java.nio.ByteBuffer;
import java.time.Duration;
import java.util.Objects;
import java.util.concurrent.CompletableFuture;
import java.util.concurrent.Flow;
import org.rtpm.internal.io.ClientLoop;
import org.rtpm.internal.link.LinkCall;
import org.rtpm.internal.link.LinkObject;
import org.rtpm.internal.link.Outcome;
import org.rtpm.internal.link.ServerLink;
import org.rtpm.internal.serve.ServantThread;
import org.rtpm.internal.wire.Delivery;
import org.rtpm.internal.wire.Limits;
import org.rtpm.values.BadValue;
import org.rtpm.values.CallContext;
import org.rtpm.values.Interface;
import org.rtpm.values.Kind;
import org.rtpm.values.Method;

/**
 * An object of a server, bound by {@link Node#bind}. It survives the server's restart: the next
 * call opens a session and binds again.
 *
 * <p>Bound by a name, it follows the name: when its server does not answer, it looks the name up
 * again, at most once a second, and later calls go where it leads.
 *
 * <p>A call runs at most once. Within a servant's method a call inherits that method's priority,
 * and waits no longer than its caller does.
 *
 * <p>Threads: any, several calls at once. Futures complete on the node's thread: what depends on
 * them must not wait there.
 */
public final class Binding implements Caller, AutoCloseable {
  /** Where the object is, and the way there. */
  record Target(ServerLink link, LinkObject object, Address address) {}

  /** How often a name is looked up again while its server does not answer. */
  private static final long FOLLOW_INTERVAL_NS = 1_000_000_000;

  private final Node node;
  /** Null: it was bound by an address. */
  private final String name;
  private final Interface description;
  private volatile Target target;
  private boolean isClosed;
  private boolean isFollowing;
  private long followedAt;

  Binding(Node node, String name, Target target, Interface description) {
    this.node = node;
    this.name = name;
    this.target = target;
    this.description = description;
    followedAt = ClientLoop.now() - FOLLOW_INTERVAL_NS;
  }

  /** Where the object is now. */
  public Address address() {
    return target.address;
  }

  /** How messages name the object. */
  String subject(Target at) {
    return Failures.subject(name, at.address);
  }

  CallException failure(Target at, Method<?, ?> method, Outcome outcome) {
    return Failures.ofCall(name, at.address, method, outcome);
  }

  Target target() {
    return target;
  }

  /** The interface that it was bound by. */
  public Interface description() {
    return description;
  }

  @Override
  public <Q, R> CompletableFuture<R> call(Method<Q, R> method, Q request, CallOptions options) {
    if (method.kind() == Kind.STREAM || method.kind() == Kind.ONEWAY) {
      throw new IllegalArgumentException(method.name() + " is no call with a reply");
    }
    byte[] payload;
    try {
      payload = encode(method, request);
    } catch (CallException e) {
      return CompletableFuture.failedFuture(e);
    }
    Target to = target;
    LinkCall[] call = new LinkCall[1];
    CallFuture<R> future = new CallFuture<>(node.loop(), () -> cancel(to, call[0]));
    Delivery delivery = method.kind() == Kind.RECEIPT ? Delivery.RECEIPT : Delivery.REPLY;
    call[0] =
        newCall(
            to,
            method,
            options,
            deadline(method, options),
            delivery,
            0,
            payload,
            outcome -> node.loop().later(() -> complete(to, future, method, outcome)));
    begin(to, call[0]);
    return future;
  }

  /**
   * Prepares a method for a loop without garbage.
   *
   * @param method whose request and reply are structs, or empty
   * @throws IllegalArgumentException if they are not, or the method is no plain call
   */
  public PreparedCall prepare(Method<?, ?> method, CallOptions options) {
    return new PreparedCall(this, method, options);
  }

  private <Q> byte[] encode(Method<Q, ?> method, Q request) {
    byte[] payload = method.request().encode(request);
    if (method.isTooLarge(payload.length)) {
      throw Failures.tooLarge(subject(target), method, "request", payload.length, WasRun.NO);
    }
    return payload;
  }

  <R> R decode(Target from, Method<?, R> method, byte[] payload) {
    if (method.isTooLarge(payload.length)) {
      throw Failures.tooLarge(subject(from), method, "reply", payload.length, WasRun.YES);
    }
    try {
      return method.reply().decode(ByteBuffer.wrap(payload));
    } catch (BadValue e) {
      throw Failures.malformedReply(subject(from), method, e.getMessage());
    }
  }

  /** Calls a method, and waits for its result. */
  public <Q, R> R invoke(Method<Q, R> method, Q request) {
    return Node.await(call(method, request));
  }

  /** Calls a method, and waits for its result. */
  public <Q, R> R invoke(Method<Q, R> method, Q request, CallOptions options) {
    return Node.await(call(method, request, options));
  }

  private <R> void complete(
      Target to, CallFuture<R> future, Method<?, R> method, Outcome outcome) {
    if (!outcome.isOk()) {
      onFailure(outcome);
      future.completeExceptionally(failure(to, method, outcome));
    } else if (method.kind() == Kind.RECEIPT) {
      future.complete(null);
    } else {
      try {
        future.complete(decode(to, method, outcome.payload()));
      } catch (CallException e) {
        future.completeExceptionally(e);
      }
    }
  }

  @Override
  public <Q> void send(Method<Q, ?> oneway, Q request, CallOptions options) {
    if (oneway.kind() != Kind.ONEWAY) {
      throw new IllegalArgumentException(oneway.name() + " is no oneway");
    }
    byte[] payload = encode(oneway, request);
    Outcome[] ended = new Outcome[1];
    Target to = target;
    begin(
        to,
        newCall(
            to,
            oneway,
            options,
            deadline(oneway, options),
            Delivery.SENT,
            0,
            payload,
            outcome -> ended[0] = outcome));
    // Null while its session is being opened; then it goes when that is done.
    if (ended[0] != null && !ended[0].isOk()) {
      throw failure(to, oneway, ended[0]);
    }
  }

  @Override
  public <Q, R> Flow.Publisher<R> stream(Method<Q, R> method, Q request, CallOptions options) {
    if (method.kind() != Kind.STREAM) {
      throw new IllegalArgumentException(method.name() + " is no stream");
    }
    byte[] payload = encode(method, request);
    return new StreamPublisher<>(this, method, payload, options);
  }

  /**
   * Measures the way to the server: how long a call of its session itself takes.
   *
   * @throws CallException if it did not answer within the node's deadline
   */
  public Duration ping() {
    long begin = ClientLoop.now();
    Target to = target;
    CompletableFuture<Outcome> ended = new CallFuture<>(node.loop(), () -> {});
    long deadline = Node.after(node.options().deadline());
    node.loop()
        .locked(
            () -> {
              checkOpen(to);
              to.link.ping(
                  to.object,
                  deadline,
                  outcome -> node.loop().later(() -> ended.complete(outcome)),
                  ClientLoop.now());
              return null;
            });
    Outcome outcome = Node.await(ended);
    if (!outcome.isOk()) {
      throw new CallException(
          subject(to) + ": ping: no answer", outcome.status(), "", WasRun.MAYBE);
    }
    return Duration.ofNanos(ClientLoop.now() - begin);
  }

  // ---- for streams ------------------------------------------------------------------------------

  Node node() {
    return node;
  }

  LinkCall newCall(
      Target to,
      Method<?, ?> method,
      CallOptions options,
      long deadline,
      Delivery delivery,
      int streamWindow,
      byte[] payload,
      LinkCall.Handler handler) {
    return LinkCall.of(
        to.object,
        (int) method.id(),
        priority(options),
        traceId(),
        deadline,
        delivery,
        streamWindow,
        method.isIdempotent(),
        payload,
        handler);
  }

  static int priority(CallOptions options) {
    CallContext serving = ServantThread.current();
    return options.priority() < 0 && serving != null ? serving.priority() : options.priority();
  }

  static long traceId() {
    CallContext serving = ServantThread.current();
    return serving == null ? 0 : serving.traceId();
  }

  long deadline(Method<?, ?> method, CallOptions options) {
    Duration wanted = options.deadline();
    if (wanted == null) {
      wanted = method.deadline().isZero() ? node.options().deadline() : method.deadline();
      CallContext serving = ServantThread.current();
      if (serving != null) {
        Duration left = serving.timeLeft().orElse(wanted);
        wanted = left.compareTo(wanted) < 0 ? left : wanted;
      }
    }
    return Node.after(wanted);
  }

  /** The deadline of a stream: none, unless the options state one. */
  static long streamDeadline(CallOptions options) {
    return options.deadline() == null ? Limits.NEVER : Node.after(options.deadline());
  }

  void begin(Target to, LinkCall call) {
    Objects.requireNonNull(call);
    node.loop()
        .locked(
            () -> {
              checkOpen(to);
              to.link.call(call, ClientLoop.now());
              return null;
            });
  }

  /** With the loop locked. */
  void checkOpen(Target to) {
    node.checkOpen();
    if (isClosed) {
      throw new IllegalStateException(subject(to) + ": the binding is closed: bind it again");
    }
  }

  void cancel(Target to, LinkCall call) {
    node.loop()
        .locked(
            () -> {
              to.link.cancel(call, ClientLoop.now());
              return null;
            });
  }

  // ---- following --------------------------------------------------------------------------------

  /** A call failed: perhaps the name leads elsewhere by now. */
  void onFailure(Outcome outcome) {
    boolean isServerGone =
        switch (outcome.cause()) {
          case DEADLINE, LOST, CLOSED, UNREACHABLE, REFUSED, NOT_UNDERSTOOD -> true;
          case REPLIED ->
              outcome.status() == Status.NO_SUCH_OBJECT
                  || outcome.status() == Status.GONE
                  || outcome.status() == Status.STOPPING;
          default -> false;
        };
    if (name == null || !isServerGone) {
      return;
    }
    boolean isDue =
        node.loop()
            .locked(
                () -> {
                  long now = ClientLoop.now();
                  boolean due =
                      !isClosed && !isFollowing && now - followedAt >= FOLLOW_INTERVAL_NS;
                  isFollowing |= due;
                  followedAt = due ? now : followedAt;
                  return due;
                });
    if (isDue) {
      node.inBackground(this::follow);
    }
  }

  private void follow() {
    Binding fresh = null;
    try {
      Address now = node.directory().addressOf(name, node.options().deadline());
      if (!now.equals(target.address)) {
        fresh = node.bindAddress(now, description, node.options().deadline());
      }
    } catch (RtpmException | NameException e) {
      // The next call that fails tries again; its own failure says what happens.
      fresh = null;
    }
    swap(fresh);
  }

  private void swap(Binding fresh) {
    Target unused =
        node.loop()
            .locked(
                () -> {
                  isFollowing = false;
                  if (fresh == null) {
                    return null;
                  }
                  if (isClosed) {
                    return fresh.target;
                  }
                  Target before = target;
                  target = fresh.target;
                  return before;
                });
    if (unused != null) {
      node.release(unused.link);
    }
  }

  /** Gives the object up. The session ends when no binding of the node uses it any more. */
  @Override
  public void close() {
    boolean wasClosed =
        node.loop()
            .locked(
                () -> {
                  boolean was = isClosed;
                  isClosed = true;
                  return was;
                });
    if (!wasClosed) {
      node.release(target.link);
    }
  }
}

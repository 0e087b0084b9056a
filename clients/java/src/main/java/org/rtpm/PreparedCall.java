package org.rtpm;

import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.util.concurrent.locks.LockSupport;
import java.util.function.Supplier;
import org.rtpm.internal.io.ClientLoop;
import org.rtpm.internal.link.LinkCall;
import org.rtpm.internal.link.Outcome;
import org.rtpm.internal.wire.Delivery;
import org.rtpm.values.Kind;
import org.rtpm.values.Method;

/**
 * A method whose request and reply are structs, for a loop without garbage: {@link #run} sends the
 * bytes of {@link #request} and writes the reply to {@link #reply}. The views of generated code
 * read and write both, such as {@code new Sample.View().wrap(call.reply(), 0)}.
 *
 * <p>Over UDP, in sessions that are not sealed, and where both fit one frame, a call that succeeds
 * allocates nothing, neither on the calling thread nor on the node's. Otherwise it works alike, but
 * makes garbage.
 *
 * <p>Threads: one at a time.
 */
public final class PreparedCall {
  private final Binding binding;
  private final Method<?, ?> method;
  private final CallOptions options;
  private final byte[] requestBytes;
  private final byte[] replyBytes;
  private final ByteBuffer request;
  private final ByteBuffer reply;
  private final ClientLoop loop;
  // Made once, as each lambda of a call would be garbage.
  private final Supplier<Void> beginning = this::begin;
  private final Runnable waking = this::wake;
  private Binding.Target to;
  private LinkCall call;
  /** With the loop locked. */
  private Outcome ending;
  private volatile Outcome outcome;
  private volatile Thread waiting;

  PreparedCall(Binding binding, Method<?, ?> method, CallOptions options) {
    this.binding = binding;
    this.method = method;
    this.options = options;
    int requestSize = method.request().fixedSize();
    int replySize = method.reply().fixedSize();
    if (method.kind() != Kind.CALL || requestSize < 0 || replySize < 0) {
      throw new IllegalArgumentException(
          method.name() + " is no call whose request and reply are structs, or empty");
    }
    requestBytes = new byte[requestSize];
    replyBytes = new byte[replySize];
    request = ByteBuffer.wrap(requestBytes).order(ByteOrder.LITTLE_ENDIAN);
    reply = ByteBuffer.wrap(replyBytes).order(ByteOrder.LITTLE_ENDIAN);
    loop = binding.node().loop();
  }

  /** The request's struct, at 0, little-endian; zeros at first. Always the same buffer. */
  public ByteBuffer request() {
    return request;
  }

  /**
   * The struct of the last reply, at 0, little-endian; zeros at first. Always the same buffer. A
   * call that fails leaves it as it was.
   */
  public ByteBuffer reply() {
    return reply;
  }

  /**
   * Calls the method, and waits for the reply, not longer than the deadline.
   *
   * @throws CallException if the call failed
   * @throws IllegalStateException if another thread runs it, if the binding is closed, or in a
   *     callback on the node's thread
   */
  public void run() {
    if (waiting != null || loop.isOwnThread()) {
      throw new IllegalStateException(
          method.name() + ": a prepared call is run by one thread, which is not the node's");
    }
    waiting = Thread.currentThread();
    try {
      renew();
      outcome = null;
      loop.locked(beginning);
      await();
      finish(outcome);
    } finally {
      waiting = null;
    }
  }

  // A binding by name may lead elsewhere by now.
  private void renew() {
    Binding.Target current = binding.target();
    if (current != to) {
      to = current;
      call =
          binding.newCall(
              to, method, options, 0, Delivery.REPLY, 0, requestBytes, this::onEnd);
      call.reuse(replyBytes);
    }
    call.renew(
        Binding.priority(options), Binding.traceId(), binding.deadline(method, options));
  }

  private Void begin() {
    binding.checkOpen(to);
    to.link().call(call, ClientLoop.now());
    return null;
  }

  private void onEnd(Outcome ended) {
    ending = ended;
    loop.later(waking);
  }

  private void wake() {
    outcome = ending;
    LockSupport.unpark(waiting);
  }

  private void await() {
    boolean wasInterrupted = false;
    while (outcome == null) {
      LockSupport.park(this);
      wasInterrupted |= Thread.interrupted();
    }
    if (wasInterrupted) {
      Thread.currentThread().interrupt();
    }
  }

  private void finish(Outcome ended) {
    if (!ended.isOk()) {
      binding.onFailure(ended);
      throw binding.failure(to, method, ended);
    }
    byte[] payload = ended.payload();
    if (payload == replyBytes) {
      return;
    }
    if (payload.length != replyBytes.length) {
      throw Failures.malformedReply(
          binding.subject(to),
          method,
          "it has " + payload.length + " bytes, not " + replyBytes.length);
    }
    System.arraycopy(payload, 0, replyBytes, 0, payload.length);
  }
}

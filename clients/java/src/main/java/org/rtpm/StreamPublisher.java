package org.rtpm;

import java.util.ArrayDeque;
import java.util.Queue;
import java.util.concurrent.Flow;
import java.util.concurrent.atomic.AtomicBoolean;
import org.rtpm.internal.io.ClientLoop;
import org.rtpm.internal.link.LinkCall;
import org.rtpm.internal.link.Outcome;
import org.rtpm.internal.wire.Delivery;
import org.rtpm.values.Method;

/** A stream of a server, for one subscriber. */
final class StreamPublisher<R> implements Flow.Publisher<R> {
  private final Binding binding;
  private final Method<?, R> method;
  private final byte[] payload;
  private final CallOptions options;
  private final AtomicBoolean isTaken = new AtomicBoolean();

  StreamPublisher(Binding binding, Method<?, R> method, byte[] payload, CallOptions options) {
    this.binding = binding;
    this.method = method;
    this.payload = payload;
    this.options = options;
  }

  @Override
  public void subscribe(Flow.Subscriber<? super R> subscriber) {
    if (isTaken.getAndSet(true)) {
      subscriber.onSubscribe(new Ended());
      subscriber.onError(new IllegalStateException("a stream is for one subscriber"));
      return;
    }
    new Subscription(subscriber).begin();
  }

  private static final class Ended implements Flow.Subscription {
    @Override
    public void request(long count) {}

    @Override
    public void cancel() {}
  }

  /** Takes items from the link as the subscriber asks for them, and gives them one at a time. */
  private final class Subscription implements Flow.Subscription, LinkCall.Handler {
    private final Flow.Subscriber<? super R> subscriber;
    private final ClientLoop loop = binding.node().loop();
    private final Binding.Target to = binding.target();
    // All of it is used with the loop locked, but for the subscriber.
    private final Queue<byte[]> taken = new ArrayDeque<>();
    private LinkCall call;
    private long demand;
    private Outcome end;
    private boolean isDelivering;
    private boolean isOver;
    private RuntimeException misuse;

    Subscription(Flow.Subscriber<? super R> subscriber) {
      this.subscriber = subscriber;
    }

    void begin() {
      call =
          binding.newCall(
              to,
              method,
              options,
              Binding.streamDeadline(options),
              Delivery.REPLY,
              binding.node().options().streamWindow(),
              payload,
              this);
      subscriber.onSubscribe(this);
      if (!isOver) {
        binding.begin(to, call);
      }
    }

    @Override
    public void request(long count) {
      loop.locked(
          () -> {
            if (count <= 0) {
              misuse = new IllegalArgumentException("a subscriber asks for more than 0 items");
            }
            demand = demand + count < 0 ? Long.MAX_VALUE : demand + count;
            deliver();
            return null;
          });
    }

    @Override
    public void cancel() {
      loop.locked(
          () -> {
            if (!isOver) {
              isOver = true;
              to.link().cancel(call, ClientLoop.now());
            }
            return null;
          });
    }

    @Override
    public void onItems() {
      deliver();
    }

    @Override
    public void onEnd(Outcome outcome) {
      end = outcome;
      deliver();
    }

    // Starts the one task that calls the subscriber, if there is something for it.
    private void deliver() {
      if (isDelivering || isOver) {
        return;
      }
      take();
      if (!taken.isEmpty() || end != null || misuse != null) {
        isDelivering = true;
        loop.later(this::run);
      }
    }

    // An item that is taken is granted again to the server: so no more than are asked for.
    private void take() {
      boolean hasTaken = false;
      while (taken.size() < demand) {
        byte[] item = to.link().nextItem(call);
        if (item == null) {
          break;
        }
        hasTaken = true;
        taken.add(item);
      }
      if (hasTaken) {
        demand -= taken.size();
        to.link().flush(call, ClientLoop.now());
      }
    }

    private void run() {
      while (true) {
        Step<R> step = loop.locked(this::nextStep);
        if (step == null) {
          return;
        }
        try {
          step.run(subscriber);
        } catch (RuntimeException e) {
          cancel();
          throw e;
        }
      }
    }

    private Step<R> nextStep() {
      if (isOver) {
        isDelivering = false;
        return null;
      }
      if (misuse != null) {
        isOver = true;
        to.link().cancel(call, ClientLoop.now());
        RuntimeException fault = misuse;
        return reader -> reader.onError(fault);
      }
      if (taken.isEmpty()) {
        take();
      }
      byte[] item = taken.poll();
      if (item != null) {
        return reader -> give(reader, item);
      }
      // With items left, the end waits until they are asked for.
      if (end != null && !to.link().hasItems(call)) {
        isOver = true;
        to.link().nextItem(call); // There is none, which frees the call.
        return this::finish;
      }
      isDelivering = false;
      return null;
    }

    private void give(Flow.Subscriber<? super R> reader, byte[] item) {
      R value;
      try {
        value = binding.decode(to, method, item);
      } catch (CallException e) {
        cancel();
        reader.onError(e);
        return;
      }
      reader.onNext(value);
    }

    private void finish(Flow.Subscriber<? super R> reader) {
      if (end.isOk()) {
        reader.onComplete();
      } else {
        binding.onFailure(end);
        reader.onError(binding.failure(to, method, end));
      }
    }
  }

  /** One call of the subscriber. */
  private interface Step<R> {
    void run(Flow.Subscriber<? super R> to);
  }
}

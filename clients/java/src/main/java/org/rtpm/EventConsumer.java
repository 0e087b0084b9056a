package org.rtpm;

import java.time.Duration;
import java.util.List;
import java.util.concurrent.CompletableFuture;
import java.util.concurrent.ExecutionException;
import java.util.concurrent.Executors;
import java.util.concurrent.Flow;
import java.util.concurrent.RejectedExecutionException;
import java.util.concurrent.ScheduledExecutorService;
import java.util.concurrent.TimeUnit;
import java.util.concurrent.TimeoutException;
import java.util.concurrent.atomic.AtomicLong;
import java.util.function.Consumer;
import org.rtpm.internal.io.ClientLoop;
import rtpm.events.Batch;
import rtpm.events.DeliveryEntry;
import rtpm.events.HubClient;
import rtpm.events.HubMethods;
import rtpm.events.LossCounts;
import rtpm.events.Progress;
import rtpm.events.SubscribeRequest;
import rtpm.events.Welcome;

/**
 * A subscription at a hub. It subscribes again by itself when the hub was restarted or unreachable.
 *
 * <p>Threads: any. Events are given one at a time, on the node's thread: what takes long belongs to
 * a thread of the program's own, and calls must not be waited for there.
 */
public final class EventConsumer implements AutoCloseable {
  private static final int EVENT_SIZE_MAX = 16 * 1024 * 1024;
  private static final Duration RETRY = Duration.ofMillis(300);
  private static final Duration NOTE_INTERVAL = Duration.ofSeconds(1);

  private final Binding binding;
  private final HubClient hub;
  private final SubscribeRequest request;
  private final Consumer<Event> onEvent;
  private final ScheduledExecutorService background;
  private final AtomicLong received = new AtomicLong();
  private final AtomicLong lost = new AtomicLong();
  private final AtomicLong malformed = new AtomicLong();
  /** Completes with the first answer of the hub. */
  private final CompletableFuture<Void> begun = new CompletableFuture<>();
  private volatile Flow.Subscription stream;
  private volatile long subscription;
  private volatile String trouble = "not subscribed yet";
  private volatile boolean isClosed;

  private EventConsumer(
      Binding binding,
      String name,
      EventFilter filter,
      int queueCapacity,
      Consumer<Event> onEvent) {
    this.binding = binding;
    this.onEvent = onEvent;
    hub = new HubClient(binding);
    request =
        SubscribeRequest.builder()
            .name(name)
            .filter(filter.node())
            .delivery(DeliveryEntry.builder().queueCapacity(queueCapacity).build())
            .types(filter.typeEntries())
            .program("java")
            .process(ProcessHandle.current().pid())
            .build();
    background =
        Executors.newSingleThreadScheduledExecutor(
            task -> {
              Thread thread = new Thread(task, "rtpm-consumer");
              thread.setDaemon(true);
              return thread;
            });
  }

  /**
   * Subscribes. Returns when the hub has the subscription, so that no later event is missed; waits
   * for it as {@link Node#bind(String, org.rtpm.values.Interface)} does.
   *
   * @param hub its name, usually {@code rtpm/events}, or its address
   * @param name of the consumer, for the hub's report
   * @param onEvent gets each event
   * @throws RtpmException if the hub can't be bound, or does not answer
   * @throws NameException if its name is not bound
   * @throws IllegalArgumentException if the hub refuses the filter; the message says why
   */
  public static EventConsumer open(
      Node node, String hub, String name, EventFilter filter, Consumer<Event> onEvent) {
    Binding binding = node.bind(hub, HubMethods.INTERFACE);
    EventConsumer opened = new EventConsumer(binding, name, filter, 256, onEvent);
    try {
      opened.subscribe();
      opened.awaitBegin(hub, node.bindDeadline());
    } catch (RuntimeException e) {
      opened.close();
      throw e;
    }
    opened.background.scheduleAtFixedRate(
        opened::note, NOTE_INTERVAL.toMillis(), NOTE_INTERVAL.toMillis(), TimeUnit.MILLISECONDS);
    return opened;
  }

  private void awaitBegin(String hub, Duration patience) {
    String begin = Printable.of(hub) + ": subscribe: ";
    try {
      begun.get(Node.after(patience) - ClientLoop.now(), TimeUnit.NANOSECONDS);
    } catch (ExecutionException e) {
      throw e.getCause() instanceof RuntimeException cause ? cause : new IllegalStateException(e);
    } catch (TimeoutException e) {
      throw new CallException(
          begin + "no answer within " + patience.toMillis() + " ms. Does the hub run?",
          null,
          "",
          WasRun.MAYBE);
    } catch (InterruptedException e) {
      Thread.currentThread().interrupt();
      throw new CallException(
          begin + "the thread was interrupted", null, "", WasRun.MAYBE);
    }
  }

  private void subscribe() {
    if (!isClosed) {
      hub.subscribe(request).subscribe(new Reader());
    }
  }

  // spec/events.md, section 4: what the hub can't see.
  private void note() {
    if (subscription == 0) {
      return;
    }
    try {
      hub.note(new Progress(subscription, received.get(), 0, 0));
    } catch (RtpmException e) {
      // The next one says as much.
      trouble = e.getMessage();
    }
  }

  /** Reads one life of the subscription. */
  private final class Reader implements Flow.Subscriber<Batch> {
    private byte[] part;
    private int filled;
    /** The losses that this life reported so far. */
    private long lostBefore;

    @Override
    public void onSubscribe(Flow.Subscription source) {
      stream = source;
      source.request(Long.MAX_VALUE);
    }

    @Override
    public void onNext(Batch batch) {
      Welcome welcome = batch.welcome();
      if (welcome != null) {
        subscription = welcome.subscription();
        trouble = "";
        begun.complete(null);
      }
      if (batch.refusal() != null && !batch.refusal().isEmpty()) {
        trouble = Printable.of(batch.refusal());
        begun.completeExceptionally(
            new IllegalArgumentException(
                binding.subject(binding.target()) + " refuses the subscription: " + trouble));
      }
      if (batch.losses() != null) {
        long now = total(batch.losses());
        lost.addAndGet(Math.max(now - lostBefore, 0));
        lostBefore = now;
      }
      byte[] bytes = batch.events();
      if (batch.part() != null) {
        bytes = putTogether(batch);
      }
      if (bytes != null) {
        give(bytes);
      }
    }

    private byte[] putTogether(Batch batch) {
      long offset = batch.part().offset();
      long size = batch.part().size();
      byte[] bytes = batch.events() == null ? new byte[0] : batch.events();
      if (offset == 0 && size <= EVENT_SIZE_MAX) {
        part = new byte[(int) size];
        filled = 0;
      }
      if (part == null
          || size != part.length
          || offset != filled
          || bytes.length > part.length - filled) {
        malformed.incrementAndGet();
        part = null;
        return null;
      }
      System.arraycopy(bytes, 0, part, filled, bytes.length);
      filled += bytes.length;
      if (filled < part.length) {
        return null;
      }
      byte[] whole = part;
      part = null;
      return whole;
    }

    @Override
    public void onError(Throwable fault) {
      trouble = String.valueOf(fault.getMessage());
      begun.completeExceptionally(fault);
      again();
    }

    @Override
    public void onComplete() {
      again();
    }

    private void again() {
      subscription = 0;
      try {
        background.schedule(
            EventConsumer.this::subscribe, RETRY.toMillis(), TimeUnit.MILLISECONDS);
      } catch (RejectedExecutionException e) {
        trouble = "closed";
      }
    }
  }

  private static long total(LossCounts losses) {
    return losses.overflow()
        + losses.replaced()
        + losses.suspended()
        + losses.memory()
        + losses.tooLarge();
  }

  private void give(byte[] bytes) {
    EventBytes.Read read = EventBytes.read(bytes);
    if (read.isBroken()) {
      malformed.incrementAndGet();
    }
    List<Event> events = read.events();
    for (Event event : events) {
      if (isClosed) {
        return;
      }
      received.incrementAndGet();
      try {
        onEvent.accept(event);
      } catch (RuntimeException e) {
        // The events behind it go on.
        System.getLogger("rtpm").log(System.Logger.Level.WARNING, "a consumer failed", e);
      }
    }
  }

  /** How many events were given. */
  public long received() {
    return received.get();
  }

  /** How many accepted events the hub could not deliver: too large, or too fast for this. */
  public long lost() {
    return lost.get();
  }

  /** How many items of the hub were malformed. */
  public long malformed() {
    return malformed.get();
  }

  /** Why it is not subscribed now; empty if it is. */
  public String trouble() {
    return trouble;
  }

  /** Ends the subscription. */
  @Override
  public void close() {
    isClosed = true;
    background.shutdownNow();
    if (stream != null) {
      stream.cancel();
    }
    binding.close();
  }
}

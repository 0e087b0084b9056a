package org.rtpm.interop;

import java.io.IOException;
import java.io.OutputStream;
import java.time.Duration;
import java.util.Locale;
import java.util.Set;
import java.util.concurrent.CompletableFuture;
import java.util.concurrent.CompletionStage;
import java.util.concurrent.Executors;
import java.util.concurrent.Flow;
import java.util.concurrent.ScheduledExecutorService;
import java.util.concurrent.TimeUnit;
import java.util.concurrent.atomic.AtomicInteger;
import java.util.concurrent.atomic.AtomicLong;
import org.rtpm.EventSupplier;
import org.rtpm.Node;
import org.rtpm.NodeOptions;
import org.rtpm.PrivateKey;
import org.rtpm.Registration;
import org.rtpm.Server;
import org.rtpm.ServerOptions;
import org.rtpm.Status;
import org.rtpm.Transport;
import org.rtpm.values.CallContext;
import rtpm.interop.Bytes;
import rtpm.interop.Count;
import rtpm.interop.Emission;
import rtpm.interop.InteropMethods;
import rtpm.interop.InteropServant;
import rtpm.interop.Item;
import rtpm.interop.Measured;
import rtpm.interop.Note;
import rtpm.interop.Notes;
import rtpm.interop.Numbers;
import rtpm.interop.OtherServant;
import rtpm.interop.Pause;
import rtpm.interop.Pausing;
import rtpm.interop.Priority;
import rtpm.interop.Range;
import rtpm.interop.Refusal;
import rtpm.interop.Values;

/** Serves interop.fbs. Its lane has one thread, so that calls wait for one that holds it. */
public final class InteropServer {
  private static final long CANCEL_INTERVAL_MS = 20;
  private static final long HUB_PATIENCE_MS = 5_000;

  private final Interop.Options options;

  InteropServer(Interop.Options options) {
    this.options = options;
  }

  /** The servant, without a hub to push events to. */
  public static InteropServant servant() {
    return new Servant(null);
  }

  /** Serves until the standard input ends. */
  void run() throws IOException {
    ServerOptions how =
        ServerOptions.DEFAULT.withLanes(new ServerOptions.LaneOptions(0, 32767, 1));
    PrivateKey key = options.key();
    if (key != null) {
      how = how.withKey(key, Set.of(options.publicKey("--admit")), false);
    }
    NodeOptions calling =
        NodeOptions.DEFAULT.withTransport(Transport.TCP).withDeadline(Duration.ofSeconds(5));
    if (options.get("--registry") != null) {
      calling = calling.withRegistries(options.get("--registry"));
    }
    try (Server server = Server.open(how);
        Node node = Node.open(calling)) {
      server.serve("interop", new Servant(options.get("--registry") == null ? null : node));
      server.serve("interop/other", (OtherServant) context -> {});
      String url = server.address("interop").toString();
      Registration name = null;
      if (options.get("--name") != null) {
        name =
            Registration.create(
                node,
                options.get("--name"),
                server.address("interop"),
                InteropMethods.INTERFACE.name());
      }
      System.out.println("{\"udp\": \"" + url + "\", \"tcp\": \"" + url + "\"}");
      System.in.transferTo(OutputStream.nullOutputStream());
      if (name != null) {
        name.close();
      }
    }
  }

  private static final class Servant implements InteropServant {
    /** Null: there is no hub to push to. */
    private final Node node;
    private final AtomicLong runs = new AtomicLong();
    private final AtomicLong sum = new AtomicLong();
    private final AtomicLong notes = new AtomicLong();
    private final AtomicInteger streams = new AtomicInteger();
    private final ScheduledExecutorService clock =
        Executors.newSingleThreadScheduledExecutor(
            task -> {
              Thread thread = new Thread(task, "interop-clock");
              thread.setDaemon(true);
              return thread;
            });

    Servant(Node node) {
      this.node = node;
    }

    @Override
    public Numbers echoNumbers(Numbers request, CallContext context) {
      runs.incrementAndGet();
      return request;
    }

    @Override
    public Values echoValues(Values request, CallContext context) {
      runs.incrementAndGet();
      return request;
    }

    @Override
    public Bytes echoBytes(Bytes request, CallContext context) {
      runs.incrementAndGet();
      return request;
    }

    @Override
    public Count add(Count request, CallContext context) {
      runs.incrementAndGet();
      return new Count(sum.addAndGet(request.count()) & 0xffff_ffffL);
    }

    @Override
    public void refuse(Refusal request, CallContext context) {
      runs.incrementAndGet();
      String reason = request.reason().toString();
      Status status = Status.valueOf(reason.toUpperCase(Locale.ROOT));
      throw new org.rtpm.Refusal(status, request.text());
    }

    @Override
    public CompletionStage<Void> wait_(Pause request, CallContext context) {
      runs.incrementAndGet();
      CompletableFuture<Void> ended = new CompletableFuture<>();
      long end = System.nanoTime() + TimeUnit.MILLISECONDS.toNanos(request.milliseconds());
      lookAt(ended, end, context);
      return ended;
    }

    private void lookAt(CompletableFuture<Void> ended, long end, CallContext context) {
      long leftMs = TimeUnit.NANOSECONDS.toMillis(end - System.nanoTime());
      if (context.isCancelled()) {
        ended.completeExceptionally(new org.rtpm.Refusal(Status.CANCELLED, ""));
      } else if (context.timeLeft().orElse(Duration.ofSeconds(1)).isZero()) {
        // Later than its caller waits, a call only keeps the place of another one.
        ended.completeExceptionally(new org.rtpm.Refusal(Status.EXPIRED, ""));
      } else if (leftMs <= 0) {
        ended.complete(null);
      } else {
        clock.schedule(
            () -> lookAt(ended, end, context),
            Math.min(leftMs, CANCEL_INTERVAL_MS),
            TimeUnit.MILLISECONDS);
      }
    }

    @Override
    public Pausing hold(Pause request, CallContext context) throws InterruptedException {
      long before = runs.incrementAndGet();
      Thread.sleep(request.milliseconds());
      return new Pausing(runs.get() == before);
    }

    @Override
    public void noteSent(Note request, CallContext context) {
      runs.incrementAndGet();
      notes.incrementAndGet();
    }

    @Override
    public void noteReceived(Note request, CallContext context) {
      noteSent(request, context);
    }

    @Override
    public void noteDone(Note request, CallContext context) {
      noteSent(request, context);
    }

    @Override
    public Notes notes(CallContext context) {
      runs.incrementAndGet();
      return new Notes(notes.get());
    }

    @Override
    public Flow.Publisher<Item> countUp(Range request, CallContext context) {
      runs.incrementAndGet();
      return reader -> reader.onSubscribe(new Counting(request, reader, streams));
    }

    @Override
    public Count streams(CallContext context) {
      runs.incrementAndGet();
      return new Count(streams.get());
    }

    @Override
    public Priority priority(CallContext context) {
      runs.incrementAndGet();
      return new Priority(context.priority());
    }

    @Override
    public void emit(Emission request, CallContext context) throws InterruptedException {
      runs.incrementAndGet();
      if (node == null) {
        throw new org.rtpm.Refusal(Status.SERVANT_FAILED, "started without --registry");
      }
      try (EventSupplier supplier =
          EventSupplier.open(node, "rtpm/events", "interop", Measured.EVENT)) {
        for (int i = 0; i < request.count(); ++i) {
          supplier.push(Measured.EVENT, 0, new Measured(request.first() + i, request.text()));
        }
        long end = System.nanoTime() + TimeUnit.MILLISECONDS.toNanos(HUB_PATIENCE_MS);
        while (supplier.counts().taken() < request.count()) {
          if (System.nanoTime() > end) {
            throw new org.rtpm.Refusal(Status.SERVANT_FAILED, "the hub did not take all events");
          }
          Thread.sleep(5);
        }
      }
    }
  }

  /** The items of a count_up, given as they are asked for. */
  private static final class Counting implements Flow.Subscription {
    private final Range range;
    private final Flow.Subscriber<? super Item> reader;
    private final AtomicInteger streams;
    private final byte[] padding;
    private long demand;
    private long next;
    private boolean isGiving;
    private boolean isOver;

    Counting(Range range, Flow.Subscriber<? super Item> reader, AtomicInteger streams) {
      this.range = range;
      this.reader = reader;
      this.streams = streams;
      padding = new byte[(int) range.padding()];
      streams.incrementAndGet();
    }

    @Override
    public void request(long count) {
      synchronized (this) {
        demand += count;
        if (isGiving) {
          return;
        }
        isGiving = true;
      }
      for (Item item; (item = take()) != null; ) {
        reader.onNext(item);
        endBehind(item);
      }
    }

    private synchronized Item take() {
      if (isOver || demand == 0) {
        isGiving = false;
        return null;
      }
      --demand;
      return new Item(next++, padding);
    }

    private void endBehind(Item item) {
      if (item.number() + 1 != range.count()) {
        return;
      }
      cancel();
      if (range.failure().isEmpty()) {
        reader.onComplete();
      } else {
        reader.onError(new org.rtpm.Refusal(Status.SERVANT_FAILED, range.failure()));
      }
    }

    @Override
    public synchronized void cancel() {
      if (!isOver) {
        isOver = true;
        streams.decrementAndGet();
      }
    }
  }
}

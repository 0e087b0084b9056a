package org.rtpm;

import java.io.IOException;
import java.io.UncheckedIOException;
import java.net.InetAddress;
import java.net.InetSocketAddress;
import java.net.UnknownHostException;
import java.security.SecureRandom;
import java.time.Duration;
import java.util.ArrayList;
import java.util.HashMap;
import java.util.LinkedHashSet;
import java.util.List;
import java.util.Map;
import java.util.Set;
import java.util.concurrent.CompletableFuture;
import java.util.concurrent.CompletionException;
import java.util.concurrent.ExecutionException;
import java.util.concurrent.ExecutorService;
import java.util.concurrent.Executors;
import java.util.concurrent.TimeUnit;
import java.util.concurrent.TimeoutException;
import java.util.concurrent.atomic.AtomicLong;
import org.rtpm.internal.io.ClientLoop;
import org.rtpm.internal.link.LinkObject;
import org.rtpm.internal.link.Outcome;
import org.rtpm.internal.link.ServerLink;
import org.rtpm.internal.wire.ClockDomain;
import org.rtpm.internal.wire.Medium;
import org.rtpm.values.Interface;
import org.rtpm.values.Method;

/**
 * A program's part of the laboratory as a client: binds objects, and has the thread that receives
 * what servers answer.
 *
 * <p>Threads: any.
 */
public final class Node implements AutoCloseable {
  private static final Duration BIND_DEADLINE_MIN = Duration.ofSeconds(5);
  private static final long NANOSECONDS_PER_SECOND = 1_000_000_000;
  /** Longer deadlines are as good as none. */
  private static final long DEADLINE_MAX_SECONDS = 1_000_000_000;

  private final NodeOptions options;
  private final ClientLoop loop;
  private final SecureRandom random = new SecureRandom();
  private final long epoch = random.nextLong() | 1;
  private final long clockDomain = ClockDomain.ofThisProgram();
  private final AtomicLong channelNumber = new AtomicLong();
  private final Map<InetSocketAddress, Shared> links = new HashMap<>();
  private Directory directory;
  private ExecutorService background;

  /** A link, and how many bindings use it. */
  private static final class Shared {
    final ServerLink link;
    int useCount;

    Shared(ServerLink link) {
      this.link = link;
    }
  }

  private Node(NodeOptions options) throws IOException {
    this.options = options;
    loop = new ClientLoop(options.isSpinning());
  }

  /** Opens a node with the default options. */
  public static Node open() {
    return open(NodeOptions.DEFAULT);
  }

  /**
   * Opens a node.
   *
   * @throws UncheckedIOException if the system gives it no selector
   */
  public static Node open(NodeOptions options) {
    try {
      return new Node(options);
    } catch (IOException e) {
      throw new UncheckedIOException(e);
    }
  }

  /** How this node calls. */
  public NodeOptions options() {
    return options;
  }

  ClientLoop loop() {
    return loop;
  }

  /**
   * Binds an object within the node's deadline, but waits 5 seconds at least: a program's first
   * bind also loads its classes.
   */
  public Binding bind(String address, Interface description) {
    return bind(address, description, bindDeadline());
  }

  Duration bindDeadline() {
    Duration deadline = options.deadline();
    return deadline.compareTo(BIND_DEADLINE_MIN) < 0 ? BIND_DEADLINE_MIN : deadline;
  }

  /**
   * Binds an object: opens a session with its server, and checks that both sides mean the same
   * interface. Waits for that.
   *
   * @param address a name such as {@code lab/arm0}, which a registry knows and the binding follows,
   *     one below it such as {@code lab/arm0/config}, or an address such as {@code
   *     rtpm://127.0.0.1:7421/lab/arm0}
   * @param description the interface, from generated code
   * @param deadline relative
   * @throws BindException if the server can't be reached or has no such object
   * @throws NameException if the name is not bound
   * @throws IllegalArgumentException if the address is malformed
   * @throws IllegalStateException if the node is closed
   */
  public Binding bind(String address, Interface description, Duration deadline) {
    if (loop.isOwnThread()) {
      throw new IllegalStateException("a call's callback binds, on the thread that would do it");
    }
    if (Address.isAddress(address)) {
      return bindAddress(Address.parse(address), description, deadline);
    }
    long end = after(deadline);
    Address found = directory().addressOf(address, deadline);
    Duration left = Duration.ofNanos(Math.max(end - ClientLoop.now(), 1));
    Binding.Target target = bindAddress(found, description, left).target();
    return new Binding(this, address, target, description);
  }

  Binding bindAddress(Address parsed, Interface description, Duration deadline) {
    long end = after(deadline);
    List<InetSocketAddress> servers = resolve(parsed);
    BindException last = null;
    for (int i = 0; i < servers.size(); ++i) {
      // hp-10-2: each has an equal part of the time that is left.
      long now = ClientLoop.now();
      long part = now + (end - now) / (servers.size() - i);
      try {
        return bindAt(parsed, servers.get(i), description, part);
      } catch (BindException e) {
        if (last != null) {
          e.addSuppressed(last);
        }
        last = e;
      }
    }
    throw last;
  }

  private static List<InetSocketAddress> resolve(Address address) {
    Set<InetSocketAddress> found = new LinkedHashSet<>();
    UnknownHostException unknown = null;
    for (String host : address.hosts()) {
      try {
        for (InetAddress each : InetAddress.getAllByName(host)) {
          found.add(new InetSocketAddress(each, address.port()));
        }
      } catch (UnknownHostException e) {
        unknown = e;
      }
    }
    if (found.isEmpty()) {
      throw new BindException(
          Failures.subject(null, address) + ": bind failed: no host of it is known", unknown);
    }
    return new ArrayList<>(found);
  }

  private Binding bindAt(
      Address address, InetSocketAddress server, Interface description, long deadline) {
    Map<Integer, Integer> methods = new HashMap<>();
    for (Method<?, ?> method : description.methods()) {
      methods.put((int) method.id(), (int) method.fingerprint());
    }
    LinkObject object =
        new LinkObject(
            address.path(),
            description.name(),
            description.fingerprint(),
            methods,
            description.text(),
            options.priority());
    CompletableFuture<Outcome> bound = new CompletableFuture<>();
    ServerLink link =
        loop.locked(
            () -> {
              ServerLink used = use(address, server);
              used.bind(
                  object,
                  deadline,
                  outcome -> loop.later(() -> bound.complete(outcome)),
                  ClientLoop.now());
              return used;
            });
    try {
      // The link ends it at the deadline; the rest is patience with a busy machine.
      Outcome outcome =
          bound.get(deadline - ClientLoop.now() + NANOSECONDS_PER_SECOND, TimeUnit.NANOSECONDS);
      if (outcome.isOk()) {
        return new Binding(
            this, null, new Binding.Target(link, object, address), description);
      }
      release(link);
      throw new BindException(Failures.ofBind(address, server, description, outcome), null);
    } catch (InterruptedException e) {
      Thread.currentThread().interrupt();
      release(link);
      throw new BindException(address + ": the thread was interrupted", e);
    } catch (ExecutionException | TimeoutException e) {
      release(link);
      throw new BindException(address + ": bind failed", e);
    }
  }

  void checkOpen() {
    if (loop.isClosed()) {
      throw new IllegalStateException("the node is closed: open another one by Node.open");
    }
  }

  // With the loop locked.
  private ServerLink use(Address address, InetSocketAddress server) {
    checkOpen();
    Shared shared = links.computeIfAbsent(server, key -> new Shared(openLink(address, key)));
    ++shared.useCount;
    return shared.link;
  }

  private ServerLink openLink(Address address, InetSocketAddress server) {
    PublicKey serverKey = options.serverKey(address);
    boolean isSealed = serverKey != null;
    return loop.open(
        new ServerLink.Config(
            options.transport() == Transport.UDP ? Medium.DATAGRAM : Medium.STREAM,
            epoch,
            channelNumber::incrementAndGet,
            clockDomain,
            options.messageSizeMax(),
            random::nextInt,
            ClientLoop.isOnHost(server.getAddress()),
            isSealed ? options.key().pair() : null,
            isSealed ? serverKey.bytes() : null,
            options.presharedKey() == null ? new byte[32] : options.presharedKey()),
        server);
  }

  /** A binding no longer uses the link. */
  void release(ServerLink link) {
    loop.locked(
        () -> {
          links
              .entrySet()
              .removeIf(
                  entry -> {
                    Shared shared = entry.getValue();
                    boolean isLast = shared.link == link && --shared.useCount == 0;
                    if (isLast) {
                      loop.close(link);
                    }
                    return isLast;
                  });
          return null;
        });
  }

  /** The names that this node's registries know. */
  public Directory directory() {
    synchronized (links) {
      if (directory == null) {
        directory = new Directory(this);
      }
      return directory;
    }
  }

  /** Runs the task on a thread that may wait for calls. */
  void inBackground(Runnable task) {
    synchronized (links) {
      if (background == null) {
        background =
            Executors.newSingleThreadExecutor(
                runnable -> {
                  Thread thread = new Thread(runnable, "rtpm-names");
                  thread.setDaemon(true);
                  return thread;
                });
      }
      if (!background.isShutdown()) {
        background.execute(task);
      }
    }
  }

  /** The time of a relative deadline on the loop's clock. */
  static long after(Duration deadline) {
    long seconds = Math.min(deadline.getSeconds(), DEADLINE_MAX_SECONDS);
    return ClientLoop.now() + seconds * NANOSECONDS_PER_SECOND + deadline.getNano();
  }

  /**
   * Waits for a call.
   *
   * @return its result
   * @throws RtpmException if it failed
   * @throws java.util.concurrent.CancellationException if it was cancelled
   */
  public static <T> T await(CompletableFuture<T> call) {
    try {
      return call.join();
    } catch (CompletionException e) {
      if (e.getCause() instanceof RuntimeException cause) {
        throw cause;
      }
      throw e;
    }
  }

  /** Closes all sessions. Open calls end as cancelled. */
  @Override
  public void close() {
    synchronized (links) {
      if (background != null) {
        background.shutdownNow();
      }
    }
    loop.close();
  }
}

package org.rtpm;

import java.io.IOException;
import java.io.UncheckedIOException;
import java.net.InetAddress;
import java.net.InetSocketAddress;
import java.security.SecureRandom;
import java.time.Duration;
import java.util.ArrayList;
import java.util.Arrays;
import java.util.List;
import java.util.Map;
import java.util.concurrent.ExecutorService;
import java.util.concurrent.LinkedBlockingQueue;
import java.util.concurrent.ThreadPoolExecutor;
import java.util.concurrent.TimeUnit;
import org.rtpm.internal.io.ServerLoop;
import org.rtpm.internal.sealed.SealedServer;
import org.rtpm.internal.serve.GrantFile;
import org.rtpm.internal.serve.Lane;
import org.rtpm.internal.serve.ObjectTable;
import org.rtpm.internal.wire.ClockDomain;
import org.rtpm.internal.wire.DropReason;
import org.rtpm.internal.wire.SipHash;
import org.rtpm.values.Servant;
import org.rtpm.values.Skeleton;

/**
 * Serves objects over UDP and TCP.
 *
 * <p>Each lane serves a band of priorities and has threads of its own, which run waiting calls in
 * the order of priority. Java's threads are time-shared: a priority orders calls, it preempts none.
 *
 * <p>It also serves {@code rtpm/introspection}, by which {@code rtpm info} and {@code rtpm call}
 * find the schemas of its objects.
 *
 * <p>Threads: any. A servant's methods run on a lane's threads, several at a time.
 */
public final class Server implements AutoCloseable {
  /** How long a method that runs may go on when the server stops. */
  private static final Duration STOP_PATIENCE = Duration.ofSeconds(1);

  private final ObjectTable objects = new ObjectTable();
  private final List<Lane> lanes = new ArrayList<>();
  private final ServerLoop loop;
  private final ExecutorService keyWorker;
  private boolean isClosed;

  private Server(ServerOptions options, Map<String, Skeleton> first) throws IOException {
    GrantFile grants =
        options.authorized() == null ? null : new GrantFile(options.authorized());
    keyWorker =
        new ThreadPoolExecutor(
            0,
            1,
            10,
            TimeUnit.SECONDS,
            new LinkedBlockingQueue<>(),
            task -> {
              Thread thread = new Thread(task, "rtpm-keys");
              thread.setDaemon(true);
              return thread;
            });
    objects.addCatalog();
    first.forEach(this::serve);
    // hp-10-3: one socket for each address, so that answers come from where the frame went.
    List<InetAddress> hosts = new ArrayList<>();
    for (String host : options.hosts()) {
      hosts.addAll(Arrays.asList(InetAddress.getAllByName(host)));
    }
    loop =
        new ServerLoop(
            hosts.isEmpty() ? ServerLoop.allAddresses() : hosts,
            options.port(),
            lanes,
            options.sessionCountMax(),
            options.key() != null);
    openLanes(options, grants);
    loop.start();
  }

  private void openLanes(ServerOptions options, GrantFile grants) {
    SecureRandom random = new SecureRandom();
    Lane.Config config =
        new Lane.Config(
            random.nextLong() | 1,
            ClockDomain.ofThisProgram(),
            new SipHash(random.nextLong(), random.nextLong()),
            options.lanes().size(),
            options.ceiling(),
            options.sessionCountMax(),
            options.messageSizeMax(),
            options.largeCountMax(),
            options.streamCountMax(),
            options.queueSizeMax(),
            options.key() == null ? null : options.key().pair(),
            options.presharedKey() == null ? new byte[32] : options.presharedKey(),
            new Admission(options, grants),
            grants,
            key -> options.clients().contains(new PublicKey(key)),
            keyWorker);
    for (ServerOptions.LaneOptions lane : options.lanes()) {
      lanes.add(
          new Lane(
              config, lanes.size(), lane.low(), lane.high(), lane.threadCount(), objects, loop));
    }
  }

  private record Admission(ServerOptions options, GrantFile grants)
      implements SealedServer.Admission {
    @Override
    public boolean admits(byte[] clientKey) {
      return options.clients().contains(new PublicKey(clientKey))
          || (grants != null && grants.knows(clientKey));
    }

    @Override
    public boolean admitsUnsealed() {
      return grants == null ? options.admitsUnsealed() : grants.knows(null);
    }
  }

  /** Opens a server with the default options. */
  public static Server open() {
    return open(ServerOptions.DEFAULT);
  }

  /**
   * Opens a server, which serves from then on.
   *
   * @throws UncheckedIOException if an address can't be bound; the message names it
   */
  public static Server open(ServerOptions options) {
    return open(options, Map.of());
  }

  /**
   * Opens a server that has these objects from its first moment on. Clients of a server that was
   * restarted at its address come back at once, and one that finds its object missing gives up.
   *
   * @param objects by their paths; {@link #serve} adds others later
   * @throws UncheckedIOException if an address can't be bound; the message names it
   * @throws IllegalArgumentException if a path is malformed
   */
  public static Server open(ServerOptions options, Map<String, Skeleton> objects) {
    try {
      return new Server(options, objects);
    } catch (IOException e) {
      String where = String.join(",", options.hosts()) + ":" + options.port();
      throw new UncheckedIOException(
          new IOException(where + " can't be served: " + e.getMessage(), e));
    }
  }

  /**
   * Serves an object under a path.
   *
   * @throws IllegalArgumentException if the path is malformed, or taken
   */
  public void serve(String path, Servant servant) {
    serve(path, servant.skeleton());
  }

  /**
   * Serves an object under a path.
   *
   * @throws IllegalArgumentException if the path is malformed, or taken
   */
  public void serve(String path, Skeleton skeleton) {
    if (!Address.isPath(path)) {
      throw new IllegalArgumentException(
          "'" + Printable.of(path) + "' is no path such as lab/arm0");
    }
    if (!objects.add(path, skeleton)) {
      throw new IllegalArgumentException(path + " is served already");
    }
  }

  /** Serves the object no more. Later calls get {@code gone}; what runs goes on. */
  public void remove(String path) {
    objects.remove(path);
  }

  /** The port that it serves. */
  public int port() {
    return loop.addresses().get(0).getPort();
  }

  /** The address of an object of this server. */
  public Address address(String path) {
    List<String> hosts = new ArrayList<>();
    for (InetSocketAddress each : loop.addresses()) {
      if (hosts.size() < 8) {
        hosts.add(each.getAddress().getHostAddress());
      }
    }
    return new Address(hosts, port(), path);
  }

  /**
   * How many frames were dropped for a reason of the specification's section 8, such as {@code
   * bad_magic}.
   *
   * @throws IllegalArgumentException if there is no such reason
   */
  public long dropped(String reason) {
    long count = 0;
    for (Lane lane : lanes) {
      count += lane.dropped(DropReason.valueOf(reason.toUpperCase(java.util.Locale.ROOT)));
    }
    return count;
  }

  /**
   * Stops: methods that run may go on for a second, waiting calls end with {@code stopping}, and
   * the sessions are closed.
   */
  @Override
  public synchronized void close() {
    if (isClosed) {
      return;
    }
    isClosed = true;
    for (Lane lane : lanes) {
      lane.stop(STOP_PATIENCE.toNanos());
    }
    loop.close();
    keyWorker.shutdownNow();
  }
}

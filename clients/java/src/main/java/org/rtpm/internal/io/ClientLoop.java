package org.rtpm.internal.io;

import java.io.IOException;
import java.net.InetAddress;
import java.net.InetSocketAddress;
import java.net.NetworkInterface;
import java.net.SocketException;
import java.net.StandardSocketOptions;
import java.nio.ByteBuffer;
import java.nio.channels.CancelledKeyException;
import java.nio.channels.DatagramChannel;
import java.nio.channels.SelectionKey;
import java.nio.channels.Selector;
import java.nio.channels.SocketChannel;
import java.util.ArrayList;
import java.util.List;
import java.util.concurrent.locks.ReentrantLock;
import java.util.function.Consumer;
import java.util.function.Supplier;
import org.rtpm.internal.DeferredTasks;
import org.rtpm.internal.link.ChannelOfBand;
import org.rtpm.internal.link.ServerLink;
import org.rtpm.internal.wire.FrameSink;
import org.rtpm.internal.wire.Limits;
import org.rtpm.internal.wire.Medium;

/**
 * The sockets of a node's links, and the thread that reads them.
 *
 * <p>All links are used through {@link #locked}; what these leave in {@link #later} runs after the
 * lock was released.
 */
public final class ClientLoop implements AutoCloseable {
  private static final int DATAGRAM_SIZE_MAX = 65_535;
  private static final int DATAGRAM_BUFFER_SIZE = 1024 * 1024;
  /** Datagrams of one socket that are read before others get their turn. */
  private static final int BATCH = 64;
  private static final int LOCK_ATTEMPTS = 200;
  /** The bytes kept for a server that does not read: a window of each of its calls. */
  private static final int KEPT_MAX = 8 * 4 * Limits.STREAM_FRAME_SIZE_MAX;

  private final ReentrantLock lock = new ReentrantLock();
  private final Selector selector;
  private final Thread thread;
  private final boolean isSpinning;
  private final List<ServerLink> links = new ArrayList<>();
  private final DeferredTasks later = new DeferredTasks(lock);
  private final ByteBuffer datagram = ByteBuffer.allocateDirect(DATAGRAM_SIZE_MAX);
  /** Memory for frames of links that keep none, by their sizes. */
  private final byte[][] frames =
      new byte[Limits.HEADER_SIZE + Medium.DATAGRAM.payloadSizeMax + 1][];
  private final Consumer<SelectionKey> onKey = this::onKey;
  /** When the thread does what is due, unless it is woken. */
  private volatile long wakesAt = Limits.NEVER;
  private volatile boolean isClosed;

  /**
   * Starts the thread.
   *
   * @param isSpinning it polls instead of sleeping, which takes a CPU and saves some microseconds
   */
  public ClientLoop(boolean isSpinning) throws IOException {
    this.isSpinning = isSpinning;
    selector = Selector.open();
    thread = new Thread(this::run, "rtpm-node");
    thread.setDaemon(true);
    thread.start();
  }

  /** The clock of all times. */
  public static long now() {
    return System.nanoTime();
  }

  /** Whether it was closed: then no link may send. */
  public boolean isClosed() {
    return isClosed;
  }

  /** Whether this is the thread that reads: it must not wait for an answer. */
  public boolean isOwnThread() {
    return Thread.currentThread() == thread;
  }

  /** Runs the task, which may use links, and then what it left for later. */
  public <T> T locked(Supplier<T> task) {
    T result;
    boolean isSooner;
    acquire();
    try {
      result = task.get();
      isSooner = nextTime() < wakesAt;
    } finally {
      lock.unlock();
    }
    if (isSooner) {
      selector.wakeup();
    }
    later.run();
    return result;
  }

  /** Has the task run soon, when the lock is released. Only for tasks of {@link #locked}. */
  public void later(Runnable task) {
    later.add(task);
  }

  // ---- links ------------------------------------------------------------------------------------

  /** Opens a link to a server; its sockets are opened as needed. */
  public ServerLink open(ServerLink.Config config, InetSocketAddress server) {
    ServerLink link = new ServerLink(config, new Sockets(config.medium(), server));
    links.add(link);
    return link;
  }

  /** Closes a link, and ends its calls. */
  public void close(ServerLink link) {
    link.close(now());
    links.remove(link);
  }

  /** Whether frames to the address stay on this host. */
  public static boolean isOnHost(InetAddress address) {
    if (address.isLoopbackAddress()) {
      return true;
    }
    try {
      return NetworkInterface.getByInetAddress(address) != null;
    } catch (SocketException e) {
      return false;
    }
  }

  /** A socket of a channel. */
  private abstract static class Socket {
    final ServerLink link;
    final ChannelOfBand channel;

    Socket(ServerLink link, ChannelOfBand channel) {
      this.link = link;
      this.channel = channel;
    }

    abstract void onReady(SelectionKey key);

    abstract void close();
  }

  private final class Sockets implements ServerLink.Transport {
    private final Medium medium;
    private final InetSocketAddress server;

    Sockets(Medium medium, InetSocketAddress server) {
      this.medium = medium;
      this.server = server;
    }

    @Override
    public FrameSink connect(ChannelOfBand channel) {
      return frame -> send(channel, frame);
    }

    private void send(ChannelOfBand channel, byte[] frame) {
      try {
        if (medium == Medium.DATAGRAM) {
          if (channel.attachment == null) {
            channel.attachment = new Datagrams(channel.link(), channel, server);
          }
          ((Datagrams) channel.attachment).send(frame);
        } else {
          if (channel.attachment == null) {
            channel.attachment = new Connection(channel.link(), channel, server);
          }
          ((Connection) channel.attachment).send(frame);
        }
      } catch (IOException e) {
        // Datagrams get lost; a call is repeated until its deadline. A connection's end shows by
        // its key as well.
        if (channel.attachment == null && medium == Medium.STREAM) {
          later(() -> locked(() -> onDisconnected(channel, false)));
        }
      }
    }

    private Void onDisconnected(ChannelOfBand channel, boolean wasConnected) {
      channel.link().onDisconnected(channel, wasConnected, now());
      return null;
    }

    @Override
    public void disconnect(ChannelOfBand channel) {
      if (channel.attachment != null) {
        ((Socket) channel.attachment).close();
        channel.attachment = null;
      }
    }
  }

  private final class Datagrams extends Socket {
    private final DatagramChannel socket;
    private final ByteBuffer outgoing =
        ByteBuffer.allocateDirect(Limits.HEADER_SIZE + Medium.DATAGRAM.payloadSizeMax);

    Datagrams(ServerLink link, ChannelOfBand channel, InetSocketAddress server)
        throws IOException {
      super(link, channel);
      socket = DatagramChannel.open();
      socket.setOption(StandardSocketOptions.SO_RCVBUF, DATAGRAM_BUFFER_SIZE);
      socket.configureBlocking(false);
      socket.connect(server);
      socket.register(selector, SelectionKey.OP_READ, this);
      selector.wakeup();
    }

    void send(byte[] frame) throws IOException {
      outgoing.clear().put(frame).flip();
      socket.write(outgoing);
    }

    @Override
    void onReady(SelectionKey key) {
      for (int i = 0; i < BATCH; ++i) {
        datagram.clear();
        try {
          if (socket.read(datagram) <= 0) {
            return;
          }
        } catch (IOException e) {
          // The server's port is closed: calls are repeated until their deadline, as it may start.
          continue;
        }
        datagram.flip();
        byte[] frame = memoryFor(datagram.remaining());
        datagram.get(frame);
        link.onFrame(channel, frame, now());
      }
    }

    private byte[] memoryFor(int size) {
      // A seal keeps frames of its handshakes.
      if (link.isSealed() || size >= frames.length) {
        return new byte[size];
      }
      if (frames[size] == null) {
        frames[size] = new byte[size];
      }
      return frames[size];
    }

    @Override
    void close() {
      closeQuietly(socket);
    }
  }

  private final class Connection extends Socket {
    private final SocketChannel socket;
    private final FrameReader reader;
    private final FrameWriter writer;
    private final SelectionKey key;

    Connection(ServerLink link, ChannelOfBand channel, InetSocketAddress server)
        throws IOException {
      super(link, channel);
      reader = new FrameReader(link.isSealed());
      socket = SocketChannel.open();
      writer = new FrameWriter(socket, KEPT_MAX);
      try {
        socket.configureBlocking(false);
        socket.setOption(StandardSocketOptions.TCP_NODELAY, true);
        boolean isConnected = socket.connect(server);
        key =
            socket.register(
                selector, isConnected ? SelectionKey.OP_READ : SelectionKey.OP_CONNECT, this);
      } catch (IOException e) {
        socket.close();
        throw e;
      }
      selector.wakeup();
    }

    void send(byte[] frame) throws IOException {
      if (!writer.write(frame)) {
        throw new IOException("the server does not read");
      }
      if (writer.hasKept() && socket.isConnected() && key.isValid()) {
        key.interestOps(SelectionKey.OP_READ | SelectionKey.OP_WRITE);
        selector.wakeup();
      }
    }

    @Override
    void onReady(SelectionKey ready) {
      boolean wasConnected = socket.isConnected();
      try {
        if (ready.isConnectable() && socket.finishConnect()) {
          ready.interestOps(SelectionKey.OP_READ);
        }
        writer.flush();
        ready.interestOps(
            SelectionKey.OP_READ | (writer.hasKept() ? SelectionKey.OP_WRITE : 0));
        if (socket.read(reader.buffer()) < 0) {
          throw new IOException("the server closed the connection");
        }
        for (byte[] frame; (frame = reader.next()) != null; ) {
          if (!link.onFrame(channel, frame, now())) {
            throw new IOException("the server does not speak the protocol");
          }
          if (channel.attachment != this) {
            return;
          }
        }
      } catch (IOException | CancelledKeyException e) {
        close();
        if (channel.attachment == this) {
          channel.attachment = null;
          link.onDisconnected(channel, wasConnected, now());
        }
      }
    }

    @Override
    void close() {
      closeQuietly(socket);
    }
  }

  static void closeQuietly(AutoCloseable socket) {
    try {
      socket.close();
    } catch (Exception e) {
      // It is closed all the same.
    }
  }

  // ---- the thread -------------------------------------------------------------------------------

  private long nextTime() {
    long next = Limits.NEVER;
    for (int i = 0; i < links.size(); ++i) {
      next = Math.min(next, links.get(i).nextTime());
    }
    return next;
  }

  private void run() {
    while (!isClosed) {
      try {
        turn();
      } catch (IOException | RuntimeException e) {
        // A fault of one turn must not end the node: calls have deadlines, which later turns keep.
        System.getLogger("rtpm").log(System.Logger.Level.WARNING, "a frame could not be read", e);
      }
    }
  }

  private void turn() throws IOException {
    long wait = wakesAt == Limits.NEVER ? Long.MAX_VALUE : wakesAt - now();
    if (isSpinning || wait <= 0) {
      selector.selectNow(onKey);
    } else {
      // In whole milliseconds, rounded up; 0 means for ever.
      selector.select(onKey, Math.min(wait / Limits.MILLISECOND + 1, 60_000));
    }
    acquire();
    try {
      long now = now();
      if (nextTime() <= now) {
        for (ServerLink link : List.copyOf(links)) {
          if (link.nextTime() <= now) {
            link.onTime(now);
          }
        }
      }
      wakesAt = nextTime();
    } finally {
      lock.unlock();
    }
    later.run();
  }

  // Holders need a microsecond: to wait in the lock's queue takes longer, and makes garbage.
  private void acquire() {
    for (int i = 0; i < LOCK_ATTEMPTS; ++i) {
      if (lock.tryLock()) {
        return;
      }
      Thread.onSpinWait();
    }
    lock.lock();
  }

  // Not by the selector's set of keys, which allocates.
  private void onKey(SelectionKey key) {
    acquire();
    try {
      if (key.isValid()) {
        ((Socket) key.attachment()).onReady(key);
      }
    } finally {
      lock.unlock();
    }
  }

  /** Closes all links and ends the thread. */
  @Override
  public void close() {
    if (isClosed) {
      return;
    }
    locked(
        () -> {
          for (ServerLink link : List.copyOf(links)) {
            close(link);
          }
          return null;
        });
    isClosed = true;
    selector.wakeup();
    if (!isOwnThread()) {
      try {
        thread.join(1000);
      } catch (InterruptedException e) {
        Thread.currentThread().interrupt();
      }
    }
    closeQuietly(selector);
  }
}

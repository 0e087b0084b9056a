package org.rtpm.internal.io;

import java.io.IOException;
import java.net.Inet6Address;
import java.net.InetAddress;
import java.net.InetSocketAddress;
import java.net.NetworkInterface;
import java.net.SocketException;
import java.net.StandardProtocolFamily;
import java.net.StandardSocketOptions;
import java.net.UnknownHostException;
import java.nio.ByteBuffer;
import java.nio.channels.CancelledKeyException;
import java.nio.channels.DatagramChannel;
import java.nio.channels.SelectionKey;
import java.nio.channels.Selector;
import java.nio.channels.ServerSocketChannel;
import java.nio.channels.SocketChannel;
import java.util.ArrayList;
import java.util.List;
import java.util.Map;
import java.util.Set;
import java.util.concurrent.ConcurrentHashMap;
import org.rtpm.internal.serve.Lane;
import org.rtpm.internal.wire.Bytes;
import org.rtpm.internal.wire.Limits;
import org.rtpm.internal.wire.Medium;
import org.rtpm.internal.wire.Peer;

/**
 * The sockets of a server, and the thread that reads them and gives each frame to the lane of its
 * priority.
 */
public final class ServerLoop implements Lane.Sender {
  private static final int DATAGRAM_SIZE_MAX = 65_535;
  private static final int DATAGRAM_BUFFER_SIZE = 1024 * 1024;
  private static final int BATCH = 64;
  /** The bytes kept for a client that does not read: a window of each of its calls. */
  private static final int KEPT_MAX = 8 * 4 * Limits.STREAM_FRAME_SIZE_MAX;
  /** hp-9: a silent connection holds a place. */
  private static final long FIRST_FRAME_PATIENCE = 2 * Limits.SECOND;
  private static final int SILENT_COUNT_MAX = 64;
  private static final long OWN_INTERVAL = 5 * Limits.SECOND;
  private static final long HOST_HERE = 0x7f00_0001L;
  /** ::ffff:0:0, behind which an IPv4 address stands. */
  private static final long IPV4_MAPPED = 0xffff_0000_0000L;

  private final List<Lane> lanes;
  private final Selector selector;
  private final Thread thread;
  private final List<DatagramChannel> datagrams = new ArrayList<>();
  private final List<ServerSocketChannel> acceptors = new ArrayList<>();
  private final List<InetSocketAddress> addresses = new ArrayList<>();
  private final Map<Long, Connection> connections = new ConcurrentHashMap<>();
  private final int connectionCountMax;
  private final boolean isSealed;
  private final ByteBuffer datagram = ByteBuffer.allocateDirect(DATAGRAM_SIZE_MAX);
  private long connectionNumber;
  private volatile boolean isClosed;
  private int port;
  /** This host's addresses, which are one host (hp-4-7); looked up again now and then. */
  private Set<InetAddress> own = Set.of();
  private long ownUntil;

  /**
   * Binds the sockets. {@link #start} begins to read them.
   *
   * @param hosts the addresses to serve, each under the same port
   * @param port 0: any that is free
   * @param isSealed whether its lanes seal sessions
   */
  public ServerLoop(
      List<InetAddress> hosts,
      int port,
      List<Lane> lanes,
      int connectionCountMax,
      boolean isSealed)
      throws IOException {
    this.lanes = lanes;
    this.port = port;
    this.connectionCountMax = connectionCountMax;
    this.isSealed = isSealed;
    selector = Selector.open();
    thread = new Thread(this::run, "rtpm-server");
    thread.setDaemon(true);
    try {
      for (InetAddress host : hosts) {
        open(host);
      }
    } catch (IOException e) {
      closeSockets();
      throw e;
    }
  }

  // A server serves UDP and TCP under the same port (hp-10).
  private void open(InetAddress host) throws IOException {
    ServerSocketChannel acceptor = ServerSocketChannel.open();
    acceptors.add(acceptor);
    acceptor.setOption(StandardSocketOptions.SO_REUSEADDR, true);
    acceptor.bind(new InetSocketAddress(host, port));
    port = ((InetSocketAddress) acceptor.getLocalAddress()).getPort();
    acceptor.configureBlocking(false);
    DatagramChannel socket =
        DatagramChannel.open(
            host instanceof Inet6Address
                ? StandardProtocolFamily.INET6
                : StandardProtocolFamily.INET);
    datagrams.add(socket);
    socket.setOption(StandardSocketOptions.SO_RCVBUF, DATAGRAM_BUFFER_SIZE);
    socket.bind(new InetSocketAddress(host, port));
    socket.configureBlocking(false);
    acceptor.register(selector, SelectionKey.OP_ACCEPT);
    socket.register(selector, SelectionKey.OP_READ, datagrams.size() - 1);
    addresses.add(new InetSocketAddress(host, port));
  }

  /** Where it serves. */
  public List<InetSocketAddress> addresses() {
    return List.copyOf(addresses);
  }

  public void start() {
    thread.start();
  }

  // ---- peers ------------------------------------------------------------------------------------

  // The first 64 bits of IPv6 are `high`. A datagram's `port` also has the socket that it came to
  // and the zone of a link-local address, too.
  private Peer peerOf(InetAddress address, long port) {
    byte[] bytes = address.getAddress();
    long high = 0;
    long low = 0;
    if (bytes.length == 4) {
      low = IPV4_MAPPED | Integer.toUnsignedLong(Integer.reverseBytes(Bytes.i32(bytes, 0)));
    } else {
      high = Long.reverseBytes(Bytes.i64(bytes, 0));
      low = Long.reverseBytes(Bytes.i64(bytes, 8));
    }
    if (address.isLoopbackAddress() || own.contains(address)) {
      return new Peer(high, low, port, 0, HOST_HERE);
    }
    return Peer.of(high, low, port);
  }

  private static InetSocketAddress addressOf(Peer peer) {
    try {
      int port = (int) (peer.port() & 0xffff);
      if (peer.high() == 0 && (peer.low() & ~0xffff_ffffL) == IPV4_MAPPED) {
        byte[] bytes = new byte[4];
        Bytes.put32(bytes, 0, Integer.reverseBytes((int) peer.low()));
        return new InetSocketAddress(InetAddress.getByAddress(bytes), port);
      }
      byte[] bytes = new byte[16];
      Bytes.put64(bytes, 0, Long.reverseBytes(peer.high()));
      Bytes.put64(bytes, 8, Long.reverseBytes(peer.low()));
      int zone = (int) (peer.port() >>> 32);
      return new InetSocketAddress(Inet6Address.getByAddress(null, bytes, zone), port);
    } catch (UnknownHostException e) {
      throw new IllegalStateException("an address has 4 or 16 bytes", e);
    }
  }

  private static long datagramPort(InetSocketAddress from, int socket) {
    long zone = from.getAddress() instanceof Inet6Address six ? six.getScopeId() : 0;
    return zone << 32 | (long) socket << 16 | from.getPort();
  }

  @Override
  public void send(Medium medium, Peer peer, byte[] frame) {
    if (medium == Medium.DATAGRAM) {
      try {
        // hp-10-3: from the address to which the client sent.
        datagrams
            .get((int) (peer.port() >>> 16 & 0xffff))
            .send(ByteBuffer.wrap(frame), addressOf(peer));
      } catch (IOException e) {
        // Datagrams get lost; clients repeat.
      }
      return;
    }
    Connection connection = connections.get(peer.port());
    if (connection != null) {
      connection.send(frame);
    }
  }

  // hp-11-2
  private Lane laneOf(byte[] frame) {
    if (frame.length >= Limits.HEADER_SIZE) {
      int priority = Bytes.u16(frame, 4);
      for (Lane lane : lanes) {
        if (lane.low <= priority && priority <= lane.high) {
          return lane;
        }
      }
    }
    return lanes.get(0);
  }

  // ---- connections ------------------------------------------------------------------------------

  private final class Connection {
    final SocketChannel socket;
    final Peer peer;
    final long opened = System.nanoTime();
    private final FrameReader reader = new FrameReader(isSealed);
    private final FrameWriter writer;
    private final SelectionKey key;
    private Lane lane;
    private volatile boolean isEnding;

    Connection(SocketChannel socket, long number) throws IOException {
      this.socket = socket;
      socket.configureBlocking(false);
      socket.setOption(StandardSocketOptions.TCP_NODELAY, true);
      InetSocketAddress from = (InetSocketAddress) socket.getRemoteAddress();
      peer = peerOf(from.getAddress(), number);
      writer = new FrameWriter(socket, KEPT_MAX);
      key = socket.register(selector, SelectionKey.OP_READ, this);
    }

    // Called by lanes.
    synchronized void send(byte[] frame) {
      try {
        if (!isEnding && !writer.write(frame)) {
          throw new IOException("the client does not read");
        }
        if (writer.hasKept()) {
          key.interestOps(SelectionKey.OP_READ | SelectionKey.OP_WRITE);
          selector.wakeup();
        }
      } catch (IOException | CancelledKeyException e) {
        isEnding = true;
        selector.wakeup();
      }
    }

    private synchronized void flush() throws IOException {
      writer.flush();
      key.interestOps(SelectionKey.OP_READ | (writer.hasKept() ? SelectionKey.OP_WRITE : 0));
    }

    void onReady() {
      try {
        flush();
        if (socket.read(reader.buffer()) < 0) {
          end();
          return;
        }
        for (byte[] frame; !isEnding && (frame = reader.next()) != null; ) {
          if (!onFrame(frame)) {
            end();
            return;
          }
        }
      } catch (IOException | CancelledKeyException e) {
        end();
      }
    }

    private boolean onFrame(byte[] frame) {
      long now = System.nanoTime();
      boolean isFirst = lane == null;
      if (isFirst) {
        lane = laneOf(frame);
        if (!hasPlace(this)) {
          lane.turnAway(frame, peer, now);
          return false;
        }
      }
      return lane.onFrame(Medium.STREAM, frame, peer, now);
    }

    boolean isSilent() {
      return lane == null;
    }

    void end() {
      isEnding = true;
      connections.remove(peer.port());
      ClientLoop.closeQuietly(socket);
      if (lane != null) {
        lane.endConnection(peer);
      }
    }
  }

  // hp-4-7: one host gets three quarters.
  private boolean hasPlace(Connection newest) {
    int count = 0;
    int ofHost = 0;
    for (Connection other : connections.values()) {
      if (!other.isSilent() && other != newest) {
        ++count;
        boolean isSameHost =
            other.peer.hostHigh() == newest.peer.hostHigh()
                && other.peer.hostLow() == newest.peer.hostLow();
        ofHost += isSameHost ? 1 : 0;
      }
    }
    return count < connectionCountMax && ofHost < Limits.shareOfOneHost(connectionCountMax);
  }

  private void accept(ServerSocketChannel acceptor) throws IOException {
    for (SocketChannel socket; (socket = acceptor.accept()) != null; ) {
      makePlaceForSilent();
      try {
        Connection connection = new Connection(socket, ++connectionNumber);
        connections.put(connectionNumber, connection);
      } catch (IOException e) {
        ClientLoop.closeQuietly(socket);
      }
    }
  }

  // hp-4-8: the oldest of the host that has most of them gives way, not the newest.
  private void makePlaceForSilent() {
    List<Connection> silent = new ArrayList<>();
    for (Connection each : connections.values()) {
      if (each.isSilent()) {
        silent.add(each);
      }
    }
    if (silent.size() < SILENT_COUNT_MAX) {
      return;
    }
    Connection chosen = null;
    int most = 0;
    for (Connection each : silent) {
      int count = 0;
      for (Connection other : silent) {
        count +=
            other.peer.hostHigh() == each.peer.hostHigh()
                    && other.peer.hostLow() == each.peer.hostLow()
                ? 1
                : 0;
      }
      if (chosen == null || count > most || (count == most && each.opened < chosen.opened)) {
        chosen = each;
        most = count;
      }
    }
    chosen.end();
  }

  private void endLateConnections(long now) {
    for (Connection each : connections.values()) {
      if (each.isEnding || (each.isSilent() && now - each.opened > FIRST_FRAME_PATIENCE)) {
        each.end();
      }
    }
  }

  // ---- the thread -------------------------------------------------------------------------------

  private void run() {
    lookUpOwn(System.nanoTime());
    while (!isClosed) {
      try {
        turn();
      } catch (IOException | RuntimeException e) {
        // A fault of one turn must not end the server.
        System.getLogger("rtpm").log(System.Logger.Level.WARNING, "a frame could not be read", e);
      }
    }
  }

  private void turn() throws IOException {
    long now = System.nanoTime();
    long next = now + (connections.isEmpty() ? Limits.SECOND : 100 * Limits.MILLISECOND);
    for (Lane lane : lanes) {
      next = Math.min(next, lane.nextTime());
    }
    selector.select(Math.max(1, (next - now) / Limits.MILLISECOND + 1));
    for (SelectionKey key : selector.selectedKeys()) {
      if (!key.isValid()) {
        continue;
      }
      if (key.channel() instanceof ServerSocketChannel acceptor) {
        accept(acceptor);
      } else if (key.attachment() instanceof Connection connection) {
        connection.onReady();
      } else {
        receive((DatagramChannel) key.channel(), (Integer) key.attachment());
      }
    }
    selector.selectedKeys().clear();
    now = System.nanoTime();
    lookUpOwn(now);
    for (Lane lane : lanes) {
      if (lane.nextTime() <= now) {
        lane.onTime(now);
      }
    }
    endLateConnections(now);
  }

  private void lookUpOwn(long now) {
    if (!own.isEmpty() && now - ownUntil < 0) {
      return;
    }
    ownUntil = now + OWN_INTERVAL;
    try {
      own = Set.copyOf(allAddresses());
    } catch (SocketException e) {
      own = Set.of();
    }
  }

  private void receive(DatagramChannel socket, int number) {
    for (int i = 0; i < BATCH; ++i) {
      datagram.clear();
      InetSocketAddress from;
      try {
        from = (InetSocketAddress) socket.receive(datagram);
      } catch (IOException e) {
        continue;
      }
      if (from == null) {
        return;
      }
      datagram.flip();
      byte[] frame = new byte[datagram.remaining()];
      datagram.get(frame);
      Peer peer = peerOf(from.getAddress(), datagramPort(from, number));
      laneOf(frame).onFrame(Medium.DATAGRAM, frame, peer, System.nanoTime());
    }
  }

  /** Ends the thread and closes the sockets. Frames that the lanes sent before go out. */
  public void close() {
    isClosed = true;
    selector.wakeup();
    try {
      if (thread != Thread.currentThread()) {
        thread.join(1000);
      }
    } catch (InterruptedException e) {
      Thread.currentThread().interrupt();
    }
    closeSockets();
  }

  private void closeSockets() {
    datagrams.forEach(ClientLoop::closeQuietly);
    acceptors.forEach(ClientLoop::closeQuietly);
    connections.values().forEach(each -> ClientLoop.closeQuietly(each.socket));
    ClientLoop.closeQuietly(selector);
  }

  /** The addresses of this host that a server serves which serves all. */
  public static List<InetAddress> allAddresses() throws SocketException {
    List<InetAddress> all = new ArrayList<>();
    for (NetworkInterface each : NetworkInterface.networkInterfaces().toList()) {
      if (each.isUp()) {
        all.addAll(each.inetAddresses().toList());
      }
    }
    return all;
  }
}

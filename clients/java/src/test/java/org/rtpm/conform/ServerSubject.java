package org.rtpm.conform;

import java.io.IOException;
import java.net.DatagramPacket;
import java.net.DatagramSocket;
import java.net.InetAddress;
import java.net.InetSocketAddress;
import java.net.ServerSocket;
import java.net.Socket;
import java.nio.charset.StandardCharsets;
import java.util.ArrayList;
import java.util.Arrays;
import java.util.HashMap;
import java.util.List;
import java.util.Locale;
import java.util.Map;
import java.util.concurrent.ThreadLocalRandom;
import org.rtpm.Status;
import org.rtpm.internal.io.FrameReader;
import org.rtpm.internal.wire.BindReply;
import org.rtpm.internal.wire.BindRequest;
import org.rtpm.internal.wire.DropReason;
import org.rtpm.internal.wire.Limits;
import org.rtpm.internal.wire.Medium;
import org.rtpm.internal.wire.Peer;
import org.rtpm.internal.wire.ServerSessions;
import org.rtpm.internal.wire.SipHash;

/** The server: the lanes' {@link ServerSessions} behind one UDP or TCP port. */
final class ServerSubject extends Subject implements ServerSessions.Handler {
  private static final long HOST = 0xffff_7f00_0001L;

  private record Lane(int low, int high, ServerSessions sessions) {}

  private static final class Running {
    final String word;
    final ServerSessions.Request request;
    final ServerSessions sessions;
    /** The item that waits for credit, as its first bytes are sent. */
    byte[] item;

    Running(String word, ServerSessions.Request request, ServerSessions sessions) {
      this.word = word;
      this.request = request;
      this.sessions = sessions;
    }
  }

  private final List<Lane> lanes = new ArrayList<>();
  private final Map<String, Running> running = new HashMap<>();
  private final Map<Long, Socket> connections = new HashMap<>();
  private ServerSessions current;
  private DatagramSocket socket;
  private long connectionCount;
  private int runs;

  ServerSubject(Line setup) throws IOException {
    Medium medium = Medium.valueOf(setup.text("medium", "").toUpperCase(Locale.ROOT));
    String[] bands = setup.text("bands", "0-32767").split(",");
    ThreadLocalRandom random = ThreadLocalRandom.current();
    long epoch = System.currentTimeMillis();
    SipHash key = new SipHash(random.nextLong(), random.nextLong());
    for (String band : bands) {
      int dash = band.indexOf('-');
      int low = Integer.parseInt(band.substring(0, dash));
      int high = Integer.parseInt(band.substring(dash + 1));
      ServerSessions.Config config =
          new ServerSessions.Config(
              medium,
              low,
              high,
              setup.integer("ceiling", Limits.PRIORITY_MAX),
              epoch,
              setup.number("clock_domain", 0),
              key,
              lanes.size(),
              bands.length,
              setup.integer("session_count_max", 256),
              setup.integer("message_size_max", 4 * 1024 * 1024),
              setup.integer("large_message_count_max", 32),
              4,
              Integer.MAX_VALUE);
      lanes.add(new Lane(low, high, new ServerSessions(config, this::send, this)));
    }
    int port = medium == Medium.DATAGRAM ? openUdp(setup.address()) : openTcp(setup.address());
    startClock();
    say("ready address=" + setup.address().getHostString() + ":" + port);
  }

  private int openUdp(InetSocketAddress address) throws IOException {
    socket = new DatagramSocket(address);
    socket.setReceiveBufferSize(1 << 21);
    startThread(
        () -> {
          DatagramPacket packet = new DatagramPacket(new byte[65_535], 65_535);
          while (true) {
            socket.receive(packet);
            byte[] frame = Arrays.copyOf(packet.getData(), packet.getLength());
            onFrame(frame, Peer.of(0, HOST, packet.getPort()));
            packet.setLength(65_535);
          }
        });
    return socket.getLocalPort();
  }

  private int openTcp(InetSocketAddress address) throws IOException {
    ServerSocket acceptor = new ServerSocket();
    acceptor.setReuseAddress(true);
    acceptor.bind(address);
    startThread(
        () -> {
          while (true) {
            Socket connection = acceptor.accept();
            connection.setTcpNoDelay(true);
            Peer peer = Peer.of(0, HOST, ++connectionCount);
            synchronized (this) {
              connections.put(peer.port(), connection);
            }
            startThread(() -> read(connection, peer));
          }
        });
    return acceptor.getLocalPort();
  }

  private void read(Socket connection, Peer peer) throws IOException {
    FrameReader reader = new FrameReader(false);
    byte[] bytes = new byte[4096];
    try (connection) {
      for (int size; (size = connection.getInputStream().read(bytes)) >= 0; ) {
        reader.buffer().put(bytes, 0, size);
        for (byte[] frame; (frame = reader.next()) != null; ) {
          if (!onFrame(frame, peer)) {
            return;
          }
        }
      }
    } finally {
      synchronized (this) {
        connections.remove(peer.port());
        lanes.forEach(lane -> lane.sessions.endConnection(peer));
      }
    }
  }

  private synchronized boolean onFrame(byte[] frame, Peer peer) {
    current = laneOf(frame);
    return current.onFrame(frame, peer, System.nanoTime());
  }

  // hp-11-2
  private ServerSessions laneOf(byte[] frame) {
    if (frame.length >= Limits.HEADER_SIZE) {
      int priority = (frame[4] & 0xff) | (frame[5] & 0xff) << 8;
      for (Lane lane : lanes) {
        if (lane.low <= priority && priority <= lane.high) {
          return lane.sessions;
        }
      }
    }
    return lanes.get(0).sessions;
  }

  private void send(Peer peer, byte[] frame) {
    try {
      if (socket != null) {
        InetAddress host = InetAddress.getLoopbackAddress();
        socket.send(new DatagramPacket(frame, frame.length, host, (int) peer.port()));
      } else if (connections.containsKey(peer.port())) {
        connections.get(peer.port()).getOutputStream().write(frame);
      }
    } catch (IOException e) {
      // The client is gone, which its reader sees, too.
    }
  }

  @Override
  void tick() {
    lanes.forEach(lane -> lane.sessions.onTime(System.nanoTime()));
  }

  @Override
  long dropped(DropReason reason) {
    return lanes.stream().mapToLong(lane -> lane.sessions.counters().dropped(reason)).sum();
  }

  @Override
  void does(Line line) {
    long now = System.nanoTime();
    if (line.word(1).equals("stop")) {
      lanes.forEach(lane -> lane.sessions.closeAll(now));
      return;
    }
    Running call = running.get(line.word(2));
    if (call == null) {
      say("cannot: no such call");
      return;
    }
    switch (line.word(1)) {
      case "receipt" -> call.sessions.accept(call.request, line.status(), now);
      case "item" -> push(call, line.payload(), now);
      case "complete" -> {
        running.remove(call.word);
        call.sessions.complete(call.request, line.status(), line.payload(), now);
      }
      default -> say("cannot do " + line.word(1));
    }
  }

  private static void push(Running call, byte[] item, long now) {
    int max = call.sessions.itemSizeMax(call.request);
    if (max > 0 && item.length > max) {
      say("sees item_too_large " + call.word);
    } else if (call.sessions.pushItem(call.request, item, now)) {
      call.item = call.sessions.isItemMidway(call.request) ? item : null;
    } else {
      say("sees no_credit " + call.word);
    }
  }

  @Override
  public void onCall(ServerSessions.Request request) {
    if (request.service() == Limits.SESSION_SERVICE) {
      answerSession(request);
      return;
    }
    String word = "c" + ++runs;
    running.put(word, new Running(word, request, current));
    say("sees run " + word + " method=" + request.method() + " payload="
        + hex(request.payload()));
  }

  private void answerSession(ServerSessions.Request request) {
    Status status = Status.OK;
    byte[] payload = {};
    if (request.method() == 1) {
      BindRequest asked = BindRequest.read(request.payload());
      if (asked == null) {
        status = Status.BAD_REQUEST;
      } else if (!asked.path().equals("lab/arm0")) {
        status = Status.NO_SUCH_OBJECT;
        payload = text("lab/arm0");
      } else if (!asked.interfaceName().equals("lab.Arm")) {
        status = Status.WRONG_INTERFACE;
        payload = text("lab.Arm");
      } else {
        payload = new BindReply(1, 0, false, true, 5, Map.of(2, 0x22222222)).payload();
      }
    }
    current.complete(request, status, payload, System.nanoTime());
  }

  // hp-5.2-1: a size of 16 bits before each text.
  private static byte[] text(String text) {
    byte[] bytes = new byte[2 + text.length()];
    bytes[0] = (byte) text.length();
    System.arraycopy(text.getBytes(StandardCharsets.US_ASCII), 0, bytes, 2, text.length());
    return bytes;
  }

  private Running runningOf(ServerSessions.Request request) {
    return running.values().stream().filter(call -> call.request == request).findAny().orElse(null);
  }

  @Override
  public void onCancelled(ServerSessions.Request request) {
    Running call = runningOf(request);
    if (call != null) {
      say("sees cancelled " + call.word);
    }
  }

  @Override
  public void onCredit(ServerSessions.Request request) {
    Running call = runningOf(request);
    if (call != null
        && call.item != null
        && call.sessions.pushItem(request, call.item, System.nanoTime())) {
      call.item = call.sessions.isItemMidway(request) ? call.item : null;
    }
  }
}

package org.rtpm.conform;

import java.io.IOException;
import java.net.DatagramPacket;
import java.net.DatagramSocket;
import java.net.InetAddress;
import java.net.InetSocketAddress;
import java.net.ServerSocket;
import java.net.Socket;
import java.nio.charset.StandardCharsets;
import java.util.Arrays;
import java.util.HashMap;
import java.util.Locale;
import java.util.Map;
import java.util.Optional;
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
import org.rtpm.vectors.Lanes;
import org.rtpm.vectors.RunningCall;

/** The server: the lanes' {@link ServerSessions} behind one UDP or TCP port. */
final class ServerSubject extends Subject implements ServerSessions.Handler {
  private static final long HOST = 0xffff_7f00_0001L;

  private final Lanes lanes = new Lanes();
  private final Map<String, RunningCall> running = new HashMap<>();
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
              lanes.count(),
              bands.length,
              setup.integer("session_count_max", 256),
              setup.integer("message_size_max", 4 * 1024 * 1024),
              setup.integer("large_message_count_max", 32),
              4,
              Integer.MAX_VALUE);
      lanes.add(low, high, new ServerSessions(config, this::send, this));
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
        lanes.all().forEach(sessions -> sessions.endConnection(peer));
      }
    }
  }

  private synchronized boolean onFrame(byte[] frame, Peer peer) {
    current = lanes.of(frame);
    return current.onFrame(frame, peer, System.nanoTime());
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
    lanes.all().forEach(sessions -> sessions.onTime(System.nanoTime()));
  }

  @Override
  long dropped(DropReason reason) {
    return lanes.all().stream().mapToLong(one -> one.counters().dropped(reason)).sum();
  }

  @Override
  void does(Line line) {
    long now = System.nanoTime();
    if (line.word(1).equals("stop")) {
      lanes.all().forEach(sessions -> sessions.closeAll(now));
      return;
    }
    RunningCall call = running.get(line.word(2));
    if (call == null) {
      say("cannot: no such call");
      return;
    }
    switch (line.word(1)) {
      case "receipt" -> call.sessions().accept(call.request(), line.status(), now);
      case "item" -> {
        String refusal = call.push(line.payload(), now);
        if (refusal != null) {
          say("sees " + refusal + " " + line.word(2));
        }
      }
      case "complete" -> {
        running.remove(line.word(2));
        call.sessions().complete(call.request(), line.status(), line.payload(), now);
      }
      default -> say("cannot do " + line.word(1));
    }
  }

  @Override
  public void onCall(ServerSessions.Request request) {
    if (request.service() == Limits.SESSION_SERVICE) {
      answerSession(request);
      return;
    }
    String word = "c" + ++runs;
    running.put(word, new RunningCall(request, current));
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

  private Optional<Map.Entry<String, RunningCall>> runningOf(ServerSessions.Request request) {
    return running.entrySet().stream()
        .filter(call -> call.getValue().request() == request)
        .findAny();
  }

  @Override
  public void onCancelled(ServerSessions.Request request) {
    runningOf(request).ifPresent(call -> say("sees cancelled " + call.getKey()));
  }

  @Override
  public void onCredit(ServerSessions.Request request) {
    runningOf(request).ifPresent(call -> call.getValue().onCredit(System.nanoTime()));
  }
}

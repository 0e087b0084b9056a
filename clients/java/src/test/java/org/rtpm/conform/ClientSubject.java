package org.rtpm.conform;

import java.io.IOException;
import java.net.DatagramPacket;
import java.net.DatagramSocket;
import java.net.InetSocketAddress;
import java.net.Socket;
import java.util.Arrays;
import java.util.HashMap;
import java.util.HashSet;
import java.util.List;
import java.util.Locale;
import java.util.Map;
import java.util.Set;
import org.rtpm.Status;
import org.rtpm.internal.io.FrameReader;
import org.rtpm.internal.wire.BindReply;
import org.rtpm.internal.wire.BindRequest;
import org.rtpm.internal.wire.CallParameters;
import org.rtpm.internal.wire.ClientChannel;
import org.rtpm.internal.wire.Delivery;
import org.rtpm.internal.wire.DropReason;
import org.rtpm.internal.wire.Medium;

/** The client: one {@link ClientChannel} on a UDP socket or a TCP connection. */
final class ClientSubject extends Subject implements ClientChannel.Listener {
  private record LostCall(String word, long epoch, long begun) {}

  private final InetSocketAddress server;
  private final ClientChannel channel;
  private final Map<String, ClientChannel.Call> calls = new HashMap<>();
  private final Map<ClientChannel.Call, String> words = new HashMap<>();
  private final Set<ClientChannel.Call> binds = new HashSet<>();
  private final Set<LostCall> lost = new HashSet<>();
  private DatagramSocket socket;
  private Socket connection;

  ClientSubject(Line setup) throws IOException {
    Medium medium = Medium.valueOf(setup.text("medium", "").toUpperCase(Locale.ROOT));
    server = setup.address();
    ClientChannel.Config config =
        new ClientChannel.Config(
            medium,
            System.currentTimeMillis(),
            1,
            setup.number("clock_domain", 0),
            setup.integer("message_size_max", 1344),
            8,
            (int) System.currentTimeMillis(),
            Integer.MAX_VALUE);
    channel = new ClientChannel(config, this::send, this);
    startClock();
    if (medium == Medium.STREAM) {
      say("ready");
      return;
    }
    socket = new DatagramSocket();
    socket.setReceiveBufferSize(1 << 21);
    socket.connect(server);
    startThread(this::readDatagrams);
    say("ready address=127.0.0.1:" + socket.getLocalPort());
  }

  private void readDatagrams() {
    DatagramPacket packet = new DatagramPacket(new byte[65_535], 65_535);
    while (true) {
      try {
        socket.receive(packet);
      } catch (IOException e) {
        continue; // The server's port is closed for now.
      }
      onFrame(Arrays.copyOf(packet.getData(), packet.getLength()));
      packet.setLength(65_535);
    }
  }

  private void connect() throws IOException {
    Socket made = new Socket(server.getAddress(), server.getPort());
    made.setTcpNoDelay(true);
    connection = made;
    startThread(() -> read(made));
  }

  private void read(Socket from) throws IOException {
    FrameReader reader = new FrameReader(false);
    byte[] bytes = new byte[4096];
    try (from) {
      for (int size; (size = from.getInputStream().read(bytes)) >= 0; ) {
        reader.buffer().put(bytes, 0, size);
        for (byte[] frame; (frame = reader.next()) != null; ) {
          onFrame(frame);
        }
      }
    } finally {
      synchronized (this) {
        connection = null;
        channel.reset();
      }
    }
  }

  private synchronized void onFrame(byte[] frame) {
    channel.onFrame(frame, System.nanoTime());
  }

  private void send(byte[] frame) {
    try {
      if (socket != null) {
        socket.send(new DatagramPacket(frame, frame.length));
      } else if (connection != null) {
        connection.getOutputStream().write(frame);
      }
    } catch (IOException e) {
      // The server is gone, which the reader sees, too.
    }
  }

  @Override
  void tick() {
    long now = System.nanoTime();
    if (channel.nextTime() <= now) {
      channel.onTime(now);
    }
  }

  @Override
  long dropped(DropReason reason) {
    return channel.counters().dropped(reason);
  }

  @Override
  void does(Line line) throws IOException {
    long now = System.nanoTime();
    String word = line.word(2);
    switch (line.word(1)) {
      case "open" -> {
        if (socket == null && connection == null) {
          connect();
        }
        channel.open(line.integer("priority", 0), deadline(line, now), now);
      }
      case "call" -> call(line, line.payload(), now);
      case "bind" -> bind(line, now);
      case "take" -> take(word, now);
      case "cancel" -> channel.cancel(calls.get(word), now);
      case "close" -> channel.close(now);
      default -> say("cannot do " + line.word(1));
    }
  }

  private static long deadline(Line line, long now) {
    return now + line.number("timeout_us", 0) * 1000;
  }

  private void call(Line line, byte[] payload, long now) {
    String word = line.word(2);
    int service = line.integer("service", 0);
    int method = line.integer("method", 1);
    int priority = line.integer("priority", 0);
    long trace = line.number("trace_id", 0);
    int window = line.integer("window", 0);
    CallParameters parameters =
        window > 0
            ? CallParameters.stream(
                service, method, priority, trace, deadline(line, now), window, 0)
            : CallParameters.call(
                service,
                method,
                priority,
                trace,
                deadline(line, now),
                Delivery.valueOf(line.text("delivery", "reply").toUpperCase(Locale.ROOT)));
    ClientChannel.Call call = channel.call(parameters, payload, now);
    if (call == null) {
      say("sees " + channel.notBegun().toString().toLowerCase(Locale.ROOT) + " " + word);
      return;
    }
    calls.put(word, call);
    words.put(call, word);
  }

  private void bind(Line line, long now) {
    BindRequest request =
        new BindRequest(
            line.number("fingerprint", 0), line.text("path", ""), line.text("interface", ""));
    call(line, request.payload(), now);
    binds.add(calls.get(line.word(2)));
  }

  private void take(String word, long now) {
    for (byte[] item; (item = channel.nextItem(calls.get(word))) != null; ) {
      say("sees item " + word + " payload=" + hex(item));
    }
    channel.flush(now);
  }

  @Override
  public void onReady() {
    say("sees ready");
    for (LostCall call : lost) {
      boolean isSafe =
          ClientChannel.hasNotRun(
              call.epoch, channel.welcome().serverEpoch(), call.begun, System.nanoTime());
      say("sees " + (isSafe ? "not_run " : "may_have_run ") + call.word);
    }
    lost.clear();
  }

  @Override
  public void onRefused(Status status) {
    say("sees refused status=" + status);
  }

  @Override
  public void onOpenTimeout() {
    say("sees timeout");
  }

  @Override
  public void onReply(ClientChannel.Call call, Status status, byte[] payload) {
    String word = words.get(call);
    if (!binds.contains(call)) {
      say("sees result " + word + " status=" + status + " payload=" + hex(payload));
      return;
    }
    BindReply reply = status == Status.OK ? BindReply.read(payload) : null;
    String service =
        reply == null ? "" : " service=" + Integer.toUnsignedString(reply.service());
    say("sees bound " + word + service);
  }

  @Override
  public void onItems(ClientChannel.Call call) {
    // The tool says when they are taken.
  }

  @Override
  public void onTimeout(ClientChannel.Call call) {
    say("sees timeout " + words.get(call));
  }

  @Override
  public void onLost(List<ClientChannel.Call> open) {
    for (ClientChannel.Call call : open) {
      lost.add(new LostCall(words.get(call), channel.welcome().serverEpoch(), call.begun()));
    }
    say("sees lost");
  }

  @Override
  public void onClosed(List<ClientChannel.Call> open) {
    say("sees closed");
  }

  @Override
  public void onBroken(List<ClientChannel.Call> open) {
    say("sees broken");
    if (connection != null) {
      try {
        connection.close();
      } catch (IOException e) {
        // It is closed all the same.
      }
    }
  }
}

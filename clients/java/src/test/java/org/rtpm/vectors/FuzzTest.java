package org.rtpm.vectors;

import static org.junit.jupiter.api.Assertions.assertTrue;

import java.util.ArrayList;
import java.util.Arrays;
import java.util.List;
import java.util.Random;
import org.junit.jupiter.api.Test;
import org.rtpm.Status;
import org.rtpm.internal.wire.BindReply;
import org.rtpm.internal.wire.BindRequest;
import org.rtpm.internal.wire.Bytes;
import org.rtpm.internal.wire.CallParameters;
import org.rtpm.internal.wire.ClientChannel;
import org.rtpm.internal.wire.Delivery;
import org.rtpm.internal.wire.FrameKind;
import org.rtpm.internal.wire.Header;
import org.rtpm.internal.wire.Hello;
import org.rtpm.internal.wire.InterfaceText;
import org.rtpm.internal.wire.Limits;
import org.rtpm.internal.wire.Medium;
import org.rtpm.internal.wire.Peer;
import org.rtpm.internal.wire.ServerSessions;
import org.rtpm.internal.wire.SipHash;
import org.rtpm.internal.wire.Welcome;

/** Frames with random faults, behind an open session: neither side throws. */
class FuzzTest {
  private static final int ROUND_COUNT = 100;
  private static final int FRAME_COUNT = 150;

  /** A frame with random numbers, of which most are near those that mean something. */
  private static byte[] frame(Random random, FrameKind kind, long session, int callId) {
    Header header = new Header();
    header.kind = kind;
    header.priority = 24000;
    header.session = random.nextInt(20) == 0 ? random.nextLong() : session;
    header.callId = callId + (random.nextInt(8) == 0 ? random.nextInt(20) - 10 : 0);
    header.service = random.nextInt(10) == 0 ? random.nextInt(3) : 1;
    header.method = random.nextInt(10) == 0 ? random.nextInt(4) : 1;
    header.statusNumber = random.nextInt(22);
    header.flags = random.nextInt(3) == 0 ? random.nextInt(16) : 0;
    header.budgetUs = random.nextInt(4) == 0 ? random.nextInt() : 1_000_000;
    header.item = random.nextInt(4) == 0 ? random.nextInt() : random.nextInt(6);
    header.senderTimeNs = random.nextInt(6) == 0 ? random.nextLong() : 1_000;
    byte[] payload = payload(random, kind);
    header.payloadSize = payload.length;
    header.messageSize = payload.length;
    if (random.nextInt(3) == 0 && payload.length > 0) {
      header.fragmentCount = 2 + random.nextInt(4);
      header.fragmentIndex = random.nextInt(header.fragmentCount);
      header.messageSize = payload.length * header.fragmentCount - random.nextInt(2);
    }
    byte[] frame = header.frame(payload, 0);
    if (random.nextInt(5) == 0) {
      frame[4 + random.nextInt(frame.length - 4)] ^= (byte) (1 << random.nextInt(8));
    }
    return random.nextInt(30) == 0
        ? Arrays.copyOf(frame, random.nextInt(frame.length))
        : frame;
  }

  private static byte[] payload(Random random, FrameKind kind) {
    int size =
        switch (kind) {
          case ACK -> 40;
          case CREDIT -> 16;
          case CANCEL, CLOSE, REFUSE -> 0;
          default -> random.nextInt(3) == 0 ? 1024 : random.nextInt(30);
        };
    byte[] payload = new byte[size];
    if (random.nextBoolean()) {
      random.nextBytes(payload);
    } else if (size > 0) {
      payload[0] = (byte) random.nextInt(6);
      payload[size - 1] = (byte) random.nextInt(4);
    }
    if (kind == FrameKind.ACK) {
      Arrays.fill(payload, 2, 8, (byte) 0);
    }
    return payload;
  }

  @Test
  void serversTakeAnyFrame() {
    FrameKind[] kinds = {
      FrameKind.CALL, FrameKind.CALL, FrameKind.CALL, FrameKind.ACK, FrameKind.CANCEL,
      FrameKind.CREDIT, FrameKind.CLOSE, FrameKind.ITEM
    };
    long calls = 0;
    for (int round = 0; round < ROUND_COUNT; ++round) {
      Random random = new Random(round);
      FuzzedServer server = new FuzzedServer(random);
      long session = server.open();
      for (int i = 0; i < FRAME_COUNT; ++i) {
        FrameKind kind = kinds[random.nextInt(kinds.length)];
        server.receive(frame(random, kind, session, i / 4));
        session = server.sessions.isKnown(session) ? session : server.open();
      }
      calls += server.callCount;
    }
    assertTrue(calls > 300, "frames get as far as calls: " + calls);
  }

  private static final class FuzzedServer implements ServerSessions.Handler {
    final Random random;
    final ServerSessions sessions;
    final List<ServerSessions.Request> running = new ArrayList<>();
    byte[] last;
    long now = 1_000_000;
    int callCount;
    int handshake;

    FuzzedServer(Random random) {
      this.random = random;
      sessions =
          new ServerSessions(
              new ServerSessions.Config(
                  random.nextBoolean() ? Medium.STREAM : Medium.DATAGRAM,
                  0, 32767, 30000, 5, 0, new SipHash(1, 2), 0, 2, 4, 5000, 3, 2,
                  Integer.MAX_VALUE),
              (peer, frame) -> last = frame,
              this);
    }

    // Over UDP the second HELLO has the cookie.
    long open() {
      byte[] cookie = new byte[16];
      ++handshake;
      while (true) {
        Header header = new Header();
        header.kind = FrameKind.HELLO;
        header.priority = 24000;
        header.callId = handshake;
        header.payloadSize = 64;
        header.messageSize = 64;
        Hello hello = new Hello(1, 1, 0, 9, 1, 0, 4000, cookie);
        sessions.onFrame(header.frame(hello.payload(), 0), Peer.of(0, 1, 1), now);
        if (last[3] == FrameKind.WELCOME.number()) {
          return Bytes.i64(last, 8);
        }
        cookie = Arrays.copyOfRange(last, 64, 80);
      }
    }

    void receive(byte[] frame) {
      now += random.nextInt(1_000_000);
      sessions.onFrame(frame, Peer.of(0, 1, random.nextInt(40) == 0 ? 2 : 1), now);
      if (sessions.nextTime() <= now) {
        sessions.onTime(now);
      }
      if (!running.isEmpty() && random.nextInt(3) == 0) {
        ServerSessions.Request request = running.remove(random.nextInt(running.size()));
        int size = random.nextInt(3) == 0 ? sessions.replySizeMax(request) : random.nextInt(9);
        sessions.complete(request, Status.of(random.nextInt(20)), new byte[size], now);
      }
    }

    @Override
    public void onCall(ServerSessions.Request request) {
      ++callCount;
      if (request.wantsReceipt() && random.nextBoolean()) {
        sessions.accept(request, Status.OK, now);
      }
      if (request.wantsStream()) {
        sessions.pushItem(request, new byte[random.nextInt(4000)], now);
      }
      running.add(request);
    }

    @Override
    public void onCancelled(ServerSessions.Request request) {}

    @Override
    public void onCredit(ServerSessions.Request request) {
      if (!sessions.isItemMidway(request)) {
        sessions.pushItem(request, new byte[5], now);
      }
    }
  }

  @Test
  void clientsTakeAnyFrame() {
    FrameKind[] kinds = {
      FrameKind.REPLY, FrameKind.REPLY, FrameKind.ITEM, FrameKind.ITEM, FrameKind.ITEM,
      FrameKind.ACK, FrameKind.REFUSE, FrameKind.CLOSE, FrameKind.WELCOME, FrameKind.CALL
    };
    long events = 0;
    for (int round = 0; round < ROUND_COUNT; ++round) {
      Random random = new Random(round);
      FuzzedClient client = new FuzzedClient(random);
      for (int i = 0; i < FRAME_COUNT; ++i) {
        client.keepGoing();
        client.channel.onFrame(
            frame(
                random,
                kinds[random.nextInt(kinds.length)],
                client.channel.session(),
                client.someCall()),
            client.now);
      }
      events += client.eventCount;
    }
    assertTrue(events > 100, "frames get as far as events: " + events);
  }

  private static final class FuzzedClient implements ClientChannel.Listener {
    final Random random;
    final ClientChannel channel;
    final List<ClientChannel.Call> calls = new ArrayList<>();
    final Medium medium;
    long now = 1_000_000;
    int eventCount;
    int handshake = 3;

    FuzzedClient(Random random) {
      this.random = random;
      medium = random.nextBoolean() ? Medium.STREAM : Medium.DATAGRAM;
      channel =
          new ClientChannel(
              new ClientChannel.Config(medium, 1, 1, 0, 5000, 8, handshake, Integer.MAX_VALUE),
              frame -> {},
              this);
    }

    void keepGoing() {
      now += random.nextInt(1_000_000);
      if (channel.nextTime() <= now) {
        channel.onTime(now);
      }
      if (!channel.isReady()) {
        channel.open(24000, Limits.NEVER, now);
        Header header = new Header();
        header.kind = FrameKind.WELCOME;
        header.priority = 24000;
        header.callId = ++handshake;
        header.session = 77;
        header.payloadSize = Welcome.SIZE;
        header.messageSize = Welcome.SIZE;
        Welcome welcome = new Welcome(0, 32767, 32767, 0, 8, 5, 0, 100_000);
        channel.onFrame(header.frame(welcome.payload(), 0), now);
      }
      if (channel.hasFreeCall()) {
        long deadline = now + 50_000_000;
        ClientChannel.Call begun =
            channel.call(
                random.nextBoolean()
                    ? CallParameters.stream(1, 1, 24000, 0, deadline, 4, 0)
                    : CallParameters.call(
                        1, 1, 24000, 0, deadline, Delivery.values()[random.nextInt(3)]),
                new byte[random.nextInt(3) == 0 ? 4000 : 4],
                now);
        if (begun != null) {
          calls.add(begun);
        }
      }
      if (!calls.isEmpty() && random.nextInt(3) == 0) {
        ClientChannel.Call call = calls.get(random.nextInt(calls.size()));
        channel.nextItem(call);
        channel.flush(now);
        if (random.nextInt(10) == 0) {
          channel.cancel(call, now);
        }
      }
    }

    int someCall() {
      int recent = Math.min(8, calls.size());
      return recent == 0 ? 0 : calls.get(calls.size() - 1 - random.nextInt(recent)).id();
    }

    @Override
    public void onReady() {}

    @Override
    public void onRefused(Status status) {}

    @Override
    public void onOpenTimeout() {}

    @Override
    public void onReply(ClientChannel.Call call, Status status, byte[] payload) {
      ++eventCount;
    }

    @Override
    public void onItems(ClientChannel.Call call) {
      ++eventCount;
    }

    @Override
    public void onTimeout(ClientChannel.Call call) {}

    @Override
    public void onLost(List<ClientChannel.Call> open) {}

    @Override
    public void onClosed(List<ClientChannel.Call> open) {}

    @Override
    public void onBroken(List<ClientChannel.Call> open) {}
  }

  @Test
  void readersTakeAnyBytes() {
    Random random = new Random(5);
    String text = Json.vectors("versions.json").at("pairs").list().get(0).at("client").text();
    for (int i = 0; i < 20_000; ++i) {
      byte[] bytes = new byte[random.nextInt(80)];
      random.nextBytes(bytes);
      BindReply.read(bytes);
      BindRequest.read(bytes);
      if (i % 20 == 0) {
        StringBuilder changed = new StringBuilder(text);
        for (int j = 0; j < 3; ++j) {
          changed.setCharAt(random.nextInt(text.length()), (char) (32 + random.nextInt(90)));
        }
        changed.setLength(random.nextInt(text.length()));
        InterfaceText.findObstacle(text, changed.toString());
      }
    }
  }
}

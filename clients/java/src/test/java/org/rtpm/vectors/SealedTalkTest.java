package org.rtpm.vectors;

import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.util.ArrayDeque;
import java.util.ArrayList;
import java.util.Arrays;
import java.util.Deque;
import java.util.List;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.EnumSource;
import org.rtpm.Status;
import org.rtpm.internal.sealed.KeyPair;
import org.rtpm.internal.sealed.SealedClient;
import org.rtpm.internal.sealed.SealedServer;
import org.rtpm.internal.sealed.Sealing;
import org.rtpm.internal.sealed.Suite;
import org.rtpm.internal.wire.CallParameters;
import org.rtpm.internal.wire.ClientChannel;
import org.rtpm.internal.wire.Delivery;
import org.rtpm.internal.wire.DropReason;
import org.rtpm.internal.wire.FrameKind;
import org.rtpm.internal.wire.Header;
import org.rtpm.internal.wire.Limits;
import org.rtpm.internal.wire.Medium;
import org.rtpm.internal.wire.Peer;
import org.rtpm.internal.wire.ServerSessions;
import org.rtpm.internal.wire.SipHash;

/** A sealed client and a sealed server talk, in virtual time, with an attacker between them. */
class SealedTalkTest {
  private static final Peer PEER = Peer.of(0, 1, 1);

  private static final class Talk
      implements ClientChannel.Listener, ServerSessions.Handler, SealedServer.Admission {
    final Deque<byte[]> toServer = new ArrayDeque<>();
    final Deque<byte[]> toClient = new ArrayDeque<>();
    final List<String> seen = new ArrayList<>();
    final Medium medium;
    final KeyPair clientKey = KeyPair.draw();
    final SealedClient sealedClient;
    final ClientChannel channel;
    ServerSessions sessions;
    SealedServer sealedServer;
    final KeyPair serverKey = KeyPair.draw();
    boolean admits = true;
    long now = 100 * Limits.SECOND;
    int runs;
    int lives;

    Talk(Medium medium) {
      this.medium = medium;
      startServer();
      sealedClient =
          new SealedClient(
              new SealedClient.Config(
                  medium, clientKey, serverKey.publicKey(), new byte[32], Suite.ALL, 5),
              toServer::add);
      channel =
          new ClientChannel(
              new ClientChannel.Config(
                  medium, 7, 1, 0, 100_000, 8, 9, Sealing.payloadSizeMax(medium)),
              sealedClient,
              this);
      sealedClient.attach(channel);
    }

    void startServer() {
      SipHash key = new SipHash(++lives, 4);
      sealedServer =
          new SealedServer(
              new SealedServer.Config(
                  medium,
                  serverKey,
                  new byte[32],
                  Suite.ALL,
                  this,
                  key,
                  16,
                  Runnable::run,
                  Runnable::run,
                  () -> now),
              (peer, frame) -> toClient.add(frame));
      sessions =
          new ServerSessions(
              new ServerSessions.Config(
                  medium,
                  0,
                  32767,
                  32767,
                  5,
                  0,
                  key,
                  0,
                  1,
                  16,
                  100_000,
                  4,
                  4,
                  Sealing.payloadSizeMax(medium)),
              sealedServer::send,
              this);
      sealedServer.attach(sessions);
    }

    void open() {
      channel.open(24000, now + Limits.SECOND, now);
      sealedClient.settle(now);
      carry();
    }

    ClientChannel.Call call(byte[] payload) {
      CallParameters parameters =
          CallParameters.call(1, 2, 24000, 0, now + Limits.SECOND, Delivery.REPLY);
      ClientChannel.Call call = channel.call(parameters, payload, now);
      sealedClient.settle(now);
      return call;
    }

    void carry() {
      while (!toServer.isEmpty() || !toClient.isEmpty()) {
        if (!toServer.isEmpty()) {
          sealedServer.onFrame(toServer.poll(), PEER, now);
        }
        if (!toClient.isEmpty()) {
          sealedClient.onFrame(toClient.poll(), now);
        }
        now += 10_000;
      }
    }

    void passTime(long until) {
      while (channel.nextTime() <= until) {
        now = channel.nextTime();
        channel.onTime(now);
        sealedClient.settle(now);
        carry();
      }
      now = Math.max(now, until);
    }

    @Override
    public boolean admits(byte[] key) {
      assertArrayEquals(clientKey.publicKey(), key);
      return admits;
    }

    @Override
    public boolean admitsUnsealed() {
      return false;
    }

    @Override
    public void onCall(ServerSessions.Request request) {
      ++runs;
      assertArrayEquals(clientKey.publicKey(), sealedServer.clientOf(request.session()));
      sessions.complete(request, Status.OK, request.payload(), now);
    }

    @Override
    public void onCancelled(ServerSessions.Request request) {}

    @Override
    public void onCredit(ServerSessions.Request request) {}

    @Override
    public void onReady() {
      seen.add("ready");
    }

    @Override
    public void onRefused(Status status) {
      seen.add("refused " + status);
    }

    @Override
    public void onOpenTimeout() {
      seen.add("timeout");
    }

    @Override
    public void onReply(ClientChannel.Call call, Status status, byte[] payload) {
      seen.add(status + " " + payload.length);
    }

    @Override
    public void onItems(ClientChannel.Call call) {}

    @Override
    public void onTimeout(ClientChannel.Call call) {
      seen.add("call timeout");
    }

    @Override
    public void onLost(List<ClientChannel.Call> open) {
      seen.add("lost");
    }

    @Override
    public void onClosed(List<ClientChannel.Call> open) {
      seen.add("closed");
    }

    @Override
    public void onBroken(List<ClientChannel.Call> open) {
      seen.add("broken");
    }
  }

  @ParameterizedTest
  @EnumSource(Medium.class)
  void callsGoSealedWhateverTheirSize(Medium medium) {
    Talk talk = new Talk(medium);
    talk.open();
    talk.call(new byte[3]);
    talk.carry();
    talk.call(new byte[90_000]);
    talk.carry();
    assertEquals(List.of("ready", "ok 3", "ok 90000"), talk.seen);
    assertEquals(0, talk.channel.counters().dropped(DropReason.BAD_LENGTH));
  }

  @Test
  void nobodyReadsNorRepeatsACall() {
    Talk talk = new Talk(Medium.DATAGRAM);
    talk.open();
    byte[] secret = {1, 2, 3, 4, 5, 6, 7, 8};
    talk.call(secret);
    byte[] frame = talk.toServer.peek();
    assertFalse(Arrays.equals(secret, Arrays.copyOfRange(frame, 64, 72)));
    talk.carry();
    talk.toServer.add(frame);
    talk.carry();
    assertEquals(1, talk.runs);
    assertEquals(1, talk.sealedServer.counters().dropped(DropReason.REPLAYED));
  }

  @Test
  void flippedBitsOfMessage1GetNoAnswer() {
    Talk talk = new Talk(Medium.DATAGRAM);
    talk.channel.open(24000, talk.now + Limits.SECOND, talk.now);
    talk.sealedServer.onFrame(talk.toServer.poll(), PEER, talk.now);
    talk.sealedClient.onFrame(talk.toClient.poll(), talk.now);
    byte[] hello = talk.toServer.poll();
    for (int at = 128; at < hello.length; at += 9) {
      byte[] forged = hello.clone();
      forged[at] ^= 4;
      talk.now += Limits.SECOND;
      talk.sealedServer.onFrame(forged, PEER, talk.now);
      assertTrue(talk.toClient.isEmpty(), "byte " + at);
    }
    assertEquals(0, talk.sessions.sessionCount());
  }

  @Test
  void keysThatAreNotAdmittedAreRefused() {
    Talk talk = new Talk(Medium.DATAGRAM);
    talk.admits = false;
    talk.open();
    talk.passTime(talk.now + 2 * Limits.SECOND);
    assertEquals(List.of("timeout"), talk.seen);
    assertEquals(Status.NOT_ALLOWED, talk.sealedClient.hint());
  }

  @Test
  void forgedRefusalsEndNothing() {
    Talk talk = new Talk(Medium.DATAGRAM);
    talk.open();
    ClientChannel.Call call = talk.call(new byte[1]);
    talk.toServer.clear();
    Header forged = new Header();
    forged.kind = FrameKind.REFUSE;
    forged.priority = 24000;
    forged.session = talk.channel.session();
    forged.callId = call.id();
    forged.statusNumber = Status.UNKNOWN_SESSION.number();
    talk.sealedClient.onFrame(forged.frame(new byte[0], 0), talk.now);
    talk.carry();
    talk.passTime(talk.now + Limits.SECOND);
    assertEquals(List.of("ready", "ok 1"), talk.seen);
    assertEquals(1, talk.runs);
  }

  @Test
  void serversThatRestartedSaySoSealed() {
    Talk talk = new Talk(Medium.DATAGRAM);
    talk.open();
    talk.startServer();
    talk.call(new byte[1]);
    talk.carry();
    assertEquals(List.of("ready", "lost"), talk.seen);
    talk.open();
    talk.call(new byte[1]);
    talk.carry();
    assertEquals(List.of("ready", "lost", "ready", "ok 1"), talk.seen);
  }

  @Test
  void strippedFramesAreDropped() {
    Talk talk = new Talk(Medium.DATAGRAM);
    talk.open();
    talk.call(new byte[5]);
    byte[] frame = talk.toServer.poll();
    Sealing.unmark(frame);
    talk.sealedServer.onFrame(frame, PEER, talk.now);
    assertEquals(1, talk.sealedServer.counters().dropped(DropReason.UNSEALED));
    assertEquals(0, talk.runs);
  }
}

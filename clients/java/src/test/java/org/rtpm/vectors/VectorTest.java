package org.rtpm.vectors;

import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertNotNull;
import static org.junit.jupiter.api.Assertions.assertNull;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.util.ArrayList;
import java.util.Arrays;
import java.util.List;
import java.util.Locale;
import java.util.Map;
import java.util.stream.Stream;
import org.junit.jupiter.api.DynamicTest;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.TestFactory;
import org.rtpm.Address;
import org.rtpm.Status;
import org.rtpm.internal.wire.BindReply;
import org.rtpm.internal.wire.BindRequest;
import org.rtpm.internal.wire.Bytes;
import org.rtpm.internal.wire.ClientChannel;
import org.rtpm.internal.wire.ClockDomain;
import org.rtpm.internal.wire.Credit;
import org.rtpm.internal.wire.Discovery;
import org.rtpm.internal.wire.DropReason;
import org.rtpm.internal.wire.FragmentAck;
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

/** The vectors of single frames, payloads and addresses in spec/vectors. */
class VectorTest {
  private interface Check {
    void run(Json vector, byte[] bytes);
  }

  private static Stream<DynamicTest> each(List<Json> vectors, Check check) {
    assertFalse(vectors.isEmpty());
    return vectors.stream()
        .map(
            vector ->
                DynamicTest.dynamicTest(
                    vector.at("name").text(), () -> check.run(vector, vector.at("hex").bytes())));
  }

  private static Stream<DynamicTest> good(String file, Check check) {
    return each(Json.vectors(file).at("good").list(), check);
  }

  private static Stream<DynamicTest> bad(String file, Check check) {
    return each(Json.vectors(file).at("bad").list(), check);
  }

  @Test
  void constantsAreTheSpecifications() {
    Json constants = Json.vectors("constants.json");
    for (FrameKind kind : FrameKind.values()) {
      assertEquals(constants.at("kinds").at(kind.name()).integer(), kind.number());
    }
    assertEquals(constants.at("kinds").keys().size(), FrameKind.values().length);
    for (String name : constants.at("statuses").keys()) {
      Status status = Status.valueOf(name.toUpperCase(Locale.ROOT));
      assertEquals(constants.at("statuses").at(name).integer(), status.number());
      assertEquals(name, status.toString());
    }
    Json limits = constants.at("limits");
    Map<String, Long> ours =
        Map.ofEntries(
            Map.entry("datagram_frame_size_max", (long) Limits.DATAGRAM_FRAME_SIZE_MAX),
            Map.entry("stream_frame_size_max", (long) Limits.STREAM_FRAME_SIZE_MAX),
            Map.entry("fragment_count_max", (long) Limits.FRAGMENT_COUNT_MAX),
            Map.entry("stream_window", (long) Limits.STREAM_WINDOW),
            Map.entry("stream_lease_max_ms", Limits.STREAM_LEASE_MAX / Limits.MILLISECOND),
            Map.entry("stream_silence_ms", Limits.STREAM_SILENCE / Limits.MILLISECOND),
            Map.entry("message_size_floor", (long) Limits.MESSAGE_SIZE_FLOOR),
            Map.entry("message_size_ceiling", (long) Limits.MESSAGE_SIZE_CEILING),
            Map.entry("call_window", (long) Limits.CALL_WINDOW),
            Map.entry("session_idle_min_s", Limits.SESSION_IDLE_MIN / Limits.SECOND),
            Map.entry("cookie_span_s", Limits.COOKIE_SPAN / Limits.SECOND),
            Map.entry("path_size_max", (long) Limits.PATH_SIZE_MAX));
    ours.forEach((name, value) -> assertEquals(limits.at(name).number(), value, name));
    assertEquals(constants.at("default_port").integer(), Limits.DEFAULT_PORT);
    assertEquals(constants.at("method_describe").integer(), Limits.METHOD_DESCRIBE);
  }

  @TestFactory
  Stream<DynamicTest> goodHeadersAreReadAndWritten() {
    return each(
        Json.vectors("headers-good.json").at("vectors").list(),
        (vector, frame) -> {
          Header header = new Header();
          assertNull(header.readFrame(frame, Medium.STREAM));
          Json wanted = vector.at("header");
          assertEquals(wanted.at("kind").text(), header.kind.name());
          assertEquals(wanted.at("priority").integer(), header.priority);
          assertEquals(wanted.at("is_repeated").flag(), header.has(Header.REPEATED));
          assertEquals(wanted.at("is_ack_wanted").flag(), header.has(Header.ACK_WANTED));
          assertEquals(wanted.at("is_no_reply").flag(), header.has(Header.NO_REPLY));
          assertEquals(
              wanted.at("is_reply_on_receipt").flag(), header.has(Header.REPLY_ON_RECEIPT));
          assertEquals(wanted.at("fragment_index").integer(), header.fragmentIndex);
          assertEquals(wanted.at("fragment_count").integer(), header.fragmentCount);
          assertEquals(wanted.at("message_size").integer(), header.messageSize);
          assertEquals(wanted.at("session").number(), header.session);
          assertEquals(wanted.at("call_id").integer(), header.callId);
          assertEquals(wanted.at("service").integer(), header.service);
          assertEquals(wanted.at("method").integer(), header.method);
          assertEquals(wanted.at("status").text(), header.status().toString());
          assertEquals(wanted.at("budget_us").integer(), header.budgetUs);
          assertEquals(wanted.at("item").integer(), header.item);
          assertEquals(wanted.at("sender_time_ns").number(), header.senderTimeNs);
          assertEquals(wanted.at("trace_id").number(), header.traceId);
          assertArrayEquals(frame, header.frame(vector.at("payload").bytes(), 0));
        });
  }

  @TestFactory
  Stream<DynamicTest> badHeadersAreDropped() {
    return each(
        Json.vectors("headers-bad.json").at("vectors").list(),
        (vector, frame) -> {
          DropReason reason =
              DropReason.valueOf(vector.at("drop").text().toUpperCase(Locale.ROOT));
          for (Json medium : vector.at("medium").list()) {
            Medium on = Medium.valueOf(medium.text().toUpperCase(Locale.ROOT));
            String receiver = vector.at("receiver").text();
            if (!receiver.equals("client")) {
              Server server = new Server(on);
              assertEquals(!vector.flag("ends_stream") || on == Medium.DATAGRAM,
                  server.receive(frame));
              assertEquals(1, server.sessions.counters().dropped(reason), receiver);
              assertTrue(server.sent.isEmpty());
            }
            if (!receiver.equals("server")) {
              Client client = new Client(on);
              client.channel.onFrame(frame, 2);
              assertEquals(1, client.channel.counters().dropped(reason));
              assertEquals(1, client.sent.size(), "the HELLO only");
              assertEquals(vector.flag("ends_stream") && on == Medium.STREAM, client.isBroken);
            }
          }
        });
  }

  @TestFactory
  Stream<DynamicTest> goodHellosAreAnswered() {
    return good(
        "hello.json",
        (vector, payload) -> {
          Hello hello = Hello.read(payload);
          assertNotNull(hello);
          Json fields = vector.at("fields");
          assertEquals(fields.at("version_min").integer(), hello.versionMin());
          assertEquals(fields.at("version_max").integer(), hello.versionMax());
          assertEquals(fields.at("features").integer(), hello.features());
          assertEquals(fields.at("client_epoch").number(), hello.clientEpoch());
          assertEquals(fields.at("channel").number(), hello.channel());
          assertEquals(fields.at("clock_domain").number(), hello.clockDomain());
          assertEquals(fields.at("message_size_max").integer(), hello.messageSizeMax());
          assertArrayEquals(fields.at("cookie").bytes(), hello.cookie());
          assertArrayEquals(payload, hello.payload());
          Server server = new Server(Medium.DATAGRAM);
          server.receive(frame(FrameKind.HELLO, 0, 5, payload));
          Header answer = server.answer();
          assertEquals(vector.at("answer").at("kind").text(), answer.kind.name());
          assertEquals(vector.at("answer").text("status", "ok"), answer.status().toString());
          assertEquals(0, server.sessions.sessionCount());
        });
  }

  @TestFactory
  Stream<DynamicTest> badHellosAreDropped() {
    return bad(
        "hello.json",
        (vector, payload) -> {
          Server server = new Server(Medium.DATAGRAM);
          server.receive(frame(FrameKind.HELLO, 0, 5, payload));
          assertTrue(server.sent.isEmpty());
          assertEquals(1, server.sessions.counters().dropped(DropReason.BAD_PAYLOAD));
          assertEquals("bad_payload", vector.at("drop").text());
        });
  }

  @TestFactory
  Stream<DynamicTest> goodCookiesAreReturned() {
    return good(
        "cookie.json",
        (vector, payload) -> {
          Client client = new Client(Medium.DATAGRAM);
          client.receive(FrameKind.COOKIE, 0, payload);
          byte[] hello = client.sent.get(1);
          assertArrayEquals(payload, Arrays.copyOfRange(hello, 104, 120));
        });
  }

  @TestFactory
  Stream<DynamicTest> badCookiesAreDropped() {
    return bad(
        "cookie.json",
        (vector, payload) -> {
          Client client = new Client(Medium.DATAGRAM);
          client.receive(FrameKind.COOKIE, 0, payload);
          assertEquals(1, client.sent.size());
          assertEquals(1, client.channel.counters().dropped(DropReason.BAD_PAYLOAD));
        });
  }

  @TestFactory
  Stream<DynamicTest> goodWelcomesOpenASession() {
    return good(
        "welcome.json",
        (vector, payload) -> {
          Client client = new Client(Medium.DATAGRAM);
          client.receive(FrameKind.WELCOME, vector.at("session").number(), payload);
          assertTrue(client.channel.isReady());
          assertEquals(vector.at("session").number(), client.channel.session());
          Welcome welcome = client.channel.welcome();
          Json fields = vector.at("fields");
          assertEquals(fields.at("band_low").integer(), welcome.bandLow());
          assertEquals(fields.at("band_high").integer(), welcome.bandHigh());
          assertEquals(fields.at("ceiling").integer(), welcome.ceiling());
          assertEquals(fields.at("window").integer(), welcome.window());
          assertEquals(fields.at("server_epoch").number(), welcome.serverEpoch());
          assertEquals(fields.at("clock_domain").number(), welcome.clockDomain());
          assertEquals(fields.at("message_size_max").integer(), welcome.messageSizeMax());
          assertArrayEquals(payload, welcome.payload());
        });
  }

  @TestFactory
  Stream<DynamicTest> badWelcomesAreDropped() {
    return bad(
        "welcome.json",
        (vector, payload) -> {
          Client client = new Client(Medium.DATAGRAM);
          client.receive(FrameKind.WELCOME, vector.at("session").number(), payload);
          assertFalse(client.channel.isReady());
          assertEquals(1, client.channel.counters().dropped(DropReason.BAD_PAYLOAD));
        });
  }

  @TestFactory
  Stream<DynamicTest> acksAreReadOrRefused() {
    return Stream.concat(
        good(
            "ack.json",
            (vector, payload) -> {
              FragmentAck ack = FragmentAck.read(payload);
              Json fields = vector.at("fields");
              assertEquals(fields.at("first_missing").integer(), ack.firstMissing());
              assertArrayEquals(fields.at("later").bytes(), ack.later());
              assertArrayEquals(payload, ack.payload());
            }),
        bad("ack.json", (vector, payload) -> assertNull(FragmentAck.read(payload))));
  }

  @TestFactory
  Stream<DynamicTest> creditsAreReadOrRefused() {
    return Stream.concat(
        good(
            "credit.json",
            (vector, payload) -> {
              Credit credit = Credit.read(payload);
              Json fields = vector.at("fields");
              assertEquals(fields.at("first_missing").integer(), credit.firstMissing());
              assertEquals(fields.at("byte_limit").integer(), credit.byteLimit());
              assertEquals(fields.at("later").number(), credit.later());
              assertArrayEquals(payload, credit.payload());
            }),
        bad("credit.json", (vector, payload) -> assertNull(Credit.read(payload))));
  }

  @TestFactory
  Stream<DynamicTest> bindRequestsAreReadOrRefused() {
    return Stream.concat(
        good(
            "bind-request.json",
            (vector, payload) -> {
              BindRequest request = BindRequest.read(payload);
              assertEquals(vector.at("path").text(), request.path());
              assertEquals(vector.at("interface").text(), request.interfaceName());
              assertEquals(vector.at("fingerprint").number(), request.fingerprint());
              assertArrayEquals(payload, request.payload());
            }),
        bad("bind-request.json", (vector, payload) -> assertNull(BindRequest.read(payload))));
  }

  @TestFactory
  Stream<DynamicTest> bindRepliesAreReadOrRefused() {
    return Stream.concat(
        good(
            "bind-reply.json",
            (vector, payload) -> {
              BindReply reply = BindReply.read(payload);
              assertEquals(vector.at("service").integer(), reply.service());
              assertEquals(vector.at("priority").integer(), reply.priority());
              assertEquals(vector.at("is_server_declared").flag(), reply.isServerDeclared());
              assertEquals(
                  vector.at("is_method_list_complete").flag(), reply.isMethodListComplete());
              assertEquals(vector.at("fingerprint").number(), reply.fingerprint());
              List<Json> methods = vector.at("methods").list();
              assertEquals(methods.size(), reply.methods().size());
              for (Json method : methods) {
                assertEquals(
                    method.at("fingerprint").integer(),
                    reply.methods().get(method.at("id").integer()));
              }
              assertArrayEquals(payload, reply.payload());
            }),
        bad("bind-reply.json", (vector, payload) -> assertNull(BindReply.read(payload))));
  }

  @TestFactory
  Stream<DynamicTest> discoveryIsReadOrDropped() {
    return Stream.concat(
        good(
            "discovery.json",
            (vector, datagram) -> {
              Discovery read = Discovery.read(datagram);
              assertEquals(vector.at("kind").text().equals("answer"), read.isAnswer());
              assertEquals(vector.at("domain").integer(), read.domain());
              assertEquals(vector.at("number").number(), read.number());
              assertEquals(vector.at("services").list().size(), read.services().size());
              assertArrayEquals(datagram, read.datagram());
            }),
        bad("discovery.json", (vector, datagram) -> assertNull(Discovery.read(datagram))));
  }

  @Test
  void addressesAreReadOrRefused() {
    Json vectors = Json.vectors("urls.json");
    for (Json vector : vectors.at("good").list()) {
      Address address = Address.parse(vector.at("text").text());
      assertEquals(
          vector.at("hosts").list().stream().map(Json::text).toList(), address.hosts());
      assertEquals(vector.at("port").integer(), address.port());
      assertEquals(vector.at("path").text(), address.path());
      assertEquals(vector.at("text").text(), address.toString());
    }
    for (Json text : vectors.at("bad").list()) {
      assertThrows(
          IllegalArgumentException.class, () -> Address.parse(text.text()), text.toString());
    }
  }

  @Test
  void clockDomainsFollowFromBootAndTimeNamespace() {
    for (Json vector : Json.vectors("clock-domain.json").at("vectors").list()) {
      assertEquals(
          vector.at("clock_domain").number(),
          ClockDomain.of(vector.at("boot_id").text(), vector.at("time_namespace").text()),
          vector.at("name").text());
    }
  }

  @TestFactory
  Stream<DynamicTest> versionsAreUnderstoodOrNot() {
    return Json.vectors("versions.json").at("pairs").list().stream()
        .map(
            pair ->
                DynamicTest.dynamicTest(
                    pair.at("name").text(),
                    () -> {
                      String obstacle =
                          InterfaceText.findObstacle(
                              pair.at("client").text(), pair.at("server").text());
                      assertEquals(pair.at("is_understood").flag(), obstacle == null, obstacle);
                    }));
  }

  @Test
  void sipHashIsTheAuthors() {
    // The first vector of the authors' test with whole words: 0 to 7 under the key 0 to 15.
    SipHash key = new SipHash(0x0706050403020100L, 0x0f0e0d0c0b0a0908L);
    assertEquals(0x93f5f5799a932462L, key.hash(0x0706050403020100L));
  }

  // ---- sides ------------------------------------------------------------------------------------

  private static byte[] frame(FrameKind kind, long session, int callId, byte[] payload) {
    Header header = new Header();
    header.kind = kind;
    header.priority = 24000;
    header.session = session;
    header.callId = callId;
    header.payloadSize = payload.length;
    header.messageSize = payload.length;
    return header.frame(payload, 0);
  }

  private static final class Server implements ServerSessions.Handler {
    final List<byte[]> sent = new ArrayList<>();
    final ServerSessions sessions;

    Server(Medium medium) {
      ServerSessions.Config config =
          new ServerSessions.Config(
              medium, 0, 32767, 32767, 1, 0, new SipHash(1, 2), 0, 1, 4, 1344, 0, 0, 65472);
      sessions = new ServerSessions(config, (peer, frame) -> sent.add(frame), this);
    }

    boolean receive(byte[] frame) {
      return sessions.onFrame(frame, Peer.of(0, 1, 1), 1);
    }

    Header answer() {
      assertEquals(1, sent.size());
      Header header = new Header();
      assertNull(header.readFrame(sent.get(0), Medium.DATAGRAM));
      return header;
    }

    @Override
    public void onCall(ServerSessions.Request request) {}

    @Override
    public void onCancelled(ServerSessions.Request request) {}

    @Override
    public void onCredit(ServerSessions.Request request) {}
  }

  /** A client that waits for the answer to its HELLO. */
  private static final class Client implements ClientChannel.Listener {
    final List<byte[]> sent = new ArrayList<>();
    final ClientChannel channel;
    boolean isBroken;

    Client(Medium medium) {
      ClientChannel.Config config =
          new ClientChannel.Config(medium, 1, 1, 0, 1344, 8, 41, Integer.MAX_VALUE);
      channel = new ClientChannel(config, sent::add, this);
      channel.open(24000, Limits.NEVER, 1);
    }

    void receive(FrameKind kind, long session, byte[] payload) {
      channel.onFrame(frame(kind, session, Bytes.i32(sent.get(0), 16), payload), 2);
    }

    @Override
    public void onReady() {}

    @Override
    public void onRefused(Status status) {}

    @Override
    public void onOpenTimeout() {}

    @Override
    public void onReply(ClientChannel.Call call, Status status, byte[] payload) {}

    @Override
    public void onItems(ClientChannel.Call call) {}

    @Override
    public void onTimeout(ClientChannel.Call call) {}

    @Override
    public void onLost(List<ClientChannel.Call> open) {}

    @Override
    public void onClosed(List<ClientChannel.Call> open) {}

    @Override
    public void onBroken(List<ClientChannel.Call> open) {
      isBroken = true;
    }
  }
}

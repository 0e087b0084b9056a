package org.rtpm;

import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertNotNull;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;
import static org.rtpm.BytesCodec.BYTES;

import java.net.DatagramPacket;
import java.net.DatagramSocket;
import java.net.InetAddress;
import java.net.Socket;
import java.nio.ByteBuffer;
import java.nio.charset.StandardCharsets;
import java.time.Duration;
import java.util.ArrayList;
import java.util.Collections;
import java.util.List;
import java.util.Map;
import java.util.Random;
import java.util.Set;
import java.util.concurrent.CompletableFuture;
import java.util.concurrent.CountDownLatch;
import java.util.concurrent.Flow;
import java.util.concurrent.SubmissionPublisher;
import java.util.concurrent.TimeUnit;
import java.util.concurrent.atomic.AtomicInteger;
import java.util.concurrent.atomic.AtomicReference;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.Timeout;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.EnumSource;
import org.rtpm.values.CallContext;
import org.rtpm.values.Codecs;
import org.rtpm.values.Interface;
import org.rtpm.values.Kind;
import org.rtpm.values.Method;
import org.rtpm.values.Operation;
import org.rtpm.values.Role;
import org.rtpm.values.Skeleton;

/** A server and a node of this package, over sockets. */
@Timeout(60)
class SocketTest {
  private static final Method<byte[], byte[]> ECHO =
      new Method<>("echo", 1, Kind.CALL, BYTES, BYTES);
  private static final Method<byte[], byte[]> COUNT =
      new Method<>("count", 2, Kind.CALL, BYTES, BYTES);
  private static final Method<byte[], Void> HINT =
      new Method<>("hint", 3, Kind.ONEWAY, BYTES, Codecs.NOTHING);
  private static final Method<byte[], Void> NOTE =
      new Method<>("note", 4, Kind.RECEIPT, BYTES, Codecs.NOTHING);
  private static final Method<byte[], byte[]> WATCH =
      new Method<>("watch", 5, Kind.STREAM, BYTES, BYTES);
  private static final Method<byte[], byte[]> REFUSE =
      new Method<>("refuse", 6, Kind.CALL, BYTES, BYTES);
  private static final Method<byte[], byte[]> SLOW =
      new Method<>("slow", 7, Kind.CALL, BYTES, BYTES);
  private static final Method<byte[], byte[]> LATER =
      new Method<>(
          "later", 8, Kind.CALL, BYTES, BYTES, 0, true, Duration.ZERO, Role.COMMAND, 0);
  /** At most 100 bytes; replies with as many as the request's first byte says. */
  private static final Method<byte[], byte[]> SMALL =
      new Method<>(
          "small", 9, Kind.CALL, BYTES, BYTES, 0, false, Duration.ZERO, Role.COMMAND, 100);
  /** One large item, and a failure at once. */
  private static final Method<byte[], byte[]> BREAK =
      new Method<>("break", 10, Kind.STREAM, BYTES, BYTES);
  private static final Interface LAB =
      new Interface(
          "lab.Test",
          77,
          List.of(ECHO, COUNT, HINT, NOTE, WATCH, REFUSE, SLOW, LATER, SMALL, BREAK));

  /** The servant of all tests. */
  private static final class Lab {
    final AtomicInteger count = new AtomicInteger();
    final List<String> heard = Collections.synchronizedList(new ArrayList<>());
    final AtomicReference<CallContext> slow = new AtomicReference<>();
    final CountDownLatch slowRuns = new CountDownLatch(1);
    final CountDownLatch mayGo = new CountDownLatch(1);
    final SubmissionPublisher<byte[]> items = new SubmissionPublisher<>(Runnable::run, 4096);
    final CompletableFuture<byte[]> later = new CompletableFuture<>();

    private static void giveAndFail(Flow.Subscriber<? super byte[]> reader) {
      reader.onSubscribe(
          new Flow.Subscription() {
            private boolean isGiven;

            @Override
            public void request(long count) {
              if (!isGiven) {
                isGiven = true;
                reader.onNext(new byte[300_000]);
                reader.onError(new Refusal(Status.SERVANT_FAILED, "the motor is hot"));
              }
            }

            @Override
            public void cancel() {}
          });
    }

    Skeleton skeleton() {
      return new Skeleton(
          LAB,
          List.of(
              new Operation.Plain<>(ECHO, (bytes, context) -> bytes),
              new Operation.Plain<>(
                  COUNT, (bytes, context) -> new byte[] {(byte) count.incrementAndGet()}),
              new Operation.Plain<>(
                  HINT,
                  (bytes, context) -> {
                    heard.add("hint");
                    return null;
                  }),
              new Operation.Plain<>(
                  NOTE,
                  (bytes, context) -> {
                    mayGo.await();
                    heard.add("note");
                    return null;
                  }),
              new Operation.Stream<>(WATCH, (bytes, context) -> items),
              new Operation.Plain<>(
                  REFUSE,
                  (bytes, context) -> {
                    if (bytes.length == 0) {
                      throw new IllegalStateException("the motor is hot");
                    }
                    throw new Refusal(Status.of(bytes[0]), "force.x is 30, but must be 20");
                  }),
              new Operation.Plain<>(
                  SLOW,
                  (bytes, context) -> {
                    slow.set(context);
                    slowRuns.countDown();
                    mayGo.await();
                    heard.add("slow " + context.priority());
                    return bytes;
                  }),
              new Operation.Deferred<>(
                  LATER,
                  (bytes, context) -> {
                    slowRuns.countDown();
                    return later;
                  }),
              new Operation.Plain<>(SMALL, (bytes, context) -> new byte[bytes[0]]),
              new Operation.Stream<>(BREAK, (bytes, context) -> Lab::giveAndFail)));
    }
  }

  private enum Way {
    UDP(Transport.UDP, false),
    TCP(Transport.TCP, false),
    SEALED_UDP(Transport.UDP, true),
    SEALED_TCP(Transport.TCP, true);

    final Transport transport;
    final boolean isSealed;

    Way(Transport transport, boolean isSealed) {
      this.transport = transport;
      this.isSealed = isSealed;
    }
  }

  /** A server with the servant, and a node that bound it. */
  private static final class Setup implements AutoCloseable {
    final Lab lab = new Lab();
    final Server server;
    final Node node;
    final Binding arm;

    Setup(Way way) {
      this(way, ServerOptions.DEFAULT);
    }

    Setup(Way way, ServerOptions options) {
      PrivateKey own = PrivateKey.draw();
      PrivateKey client = PrivateKey.draw();
      server =
          Server.open(
              way.isSealed ? options.withKey(own, Set.of(client.publicKey()), false) : options);
      server.serve("lab/arm0", lab.skeleton());
      NodeOptions calls =
          NodeOptions.DEFAULT.withTransport(way.transport).withDeadline(Duration.ofSeconds(20));
      if (way.isSealed) {
        calls = calls.withServerKey(
            client, server.address("lab/arm0").authority(), own.publicKey());
      }
      node = Node.open(calls);
      arm = node.bind(server.address("lab/arm0").toString(), LAB);
    }

    @Override
    public void close() {
      arm.close();
      node.close();
      server.close();
    }
  }

  private static byte[] bytes(int... values) {
    byte[] bytes = new byte[values.length];
    for (int i = 0; i < values.length; ++i) {
      bytes[i] = (byte) values[i];
    }
    return bytes;
  }

  @ParameterizedTest
  @EnumSource(Way.class)
  void callsOfAllSizesReturn(Way way) {
    try (Setup setup = new Setup(way)) {
      for (int size : new int[] {0, 1, 1344, 1345, 65_472, 65_473, 1_100_000}) {
        byte[] sent = new byte[size];
        new Random(size).nextBytes(sent);
        assertArrayEquals(sent, setup.arm.invoke(ECHO, sent));
      }
    }
  }

  @ParameterizedTest
  @EnumSource(Way.class)
  void manyCallsAtATimeRunOnceEach(Way way) {
    try (Setup setup = new Setup(way)) {
      List<CompletableFuture<byte[]>> calls = new ArrayList<>();
      for (int i = 0; i < 100; ++i) {
        calls.add(setup.arm.call(COUNT, bytes(i)));
      }
      calls.forEach(Node::await);
      assertEquals(100, setup.lab.count.get());
    }
  }

  @ParameterizedTest
  @EnumSource(Way.class)
  void refusalsComeWithTheirReason(Way way) {
    try (Setup setup = new Setup(way)) {
      CallException refused =
          assertThrows(CallException.class, () -> setup.arm.invoke(REFUSE, bytes(5)));
      assertEquals(Status.BAD_REQUEST, refused.status().orElseThrow());
      assertEquals("force.x is 30, but must be 20", refused.text());
      assertEquals(WasRun.NO, refused.wasRun());
      CallException gone =
          assertThrows(CallException.class, () -> setup.arm.invoke(REFUSE, bytes(7)));
      assertEquals(Status.GONE, gone.status().orElseThrow());
      CallException failed =
          assertThrows(CallException.class, () -> setup.arm.invoke(REFUSE, bytes()));
      assertEquals(Status.SERVANT_FAILED, failed.status().orElseThrow());
      assertEquals("the motor is hot", failed.text());
      assertEquals(WasRun.YES, failed.wasRun());
    }
  }

  @ParameterizedTest
  @EnumSource(Way.class)
  void onewaysArriveAndReceiptsDoNotWait(Way way) throws Exception {
    try (Setup setup = new Setup(way)) {
      setup.arm.invoke(NOTE, bytes(1));
      assertTrue(setup.lab.heard.isEmpty(), "the method waits still");
      setup.lab.mayGo.countDown();
      setup.arm.send(HINT, bytes(1));
      while (setup.lab.heard.size() < 2) {
        Thread.sleep(1);
      }
    }
  }

  @ParameterizedTest
  @EnumSource(Way.class)
  void cancelledCallsAreTold(Way way) throws Exception {
    try (Setup setup = new Setup(way)) {
      CompletableFuture<byte[]> call = setup.arm.call(SLOW, bytes(1));
      assertTrue(setup.lab.slowRuns.await(5, TimeUnit.SECONDS));
      assertTrue(call.cancel(true));
      while (!setup.lab.slow.get().isCancelled()) {
        Thread.sleep(1);
      }
      setup.lab.mayGo.countDown();
      assertArrayEquals(bytes(9), setup.arm.invoke(ECHO, bytes(9)));
    }
  }

  @ParameterizedTest
  @EnumSource(Way.class)
  void deadlinesEndCallsThatWait(Way way) {
    try (Setup setup = new Setup(way)) {
      CallOptions brief = CallOptions.DEFAULT.withDeadline(Duration.ofMillis(100));
      long begin = System.nanoTime();
      CallException late =
          assertThrows(CallException.class, () -> setup.arm.invoke(SLOW, bytes(1), brief));
      long tookMs = (System.nanoTime() - begin) / 1_000_000;
      assertEquals(WasRun.MAYBE, late.wasRun());
      assertTrue(tookMs >= 100 && tookMs < 10_000, "took " + tookMs + " ms");
      setup.lab.mayGo.countDown();
    }
  }

  @ParameterizedTest
  @EnumSource(Way.class)
  void callsThatRunOnFreeTheirPlaceAtTheirDeadline(Way way) {
    try (Setup setup = new Setup(way)) {
      CallOptions brief = CallOptions.DEFAULT.withDeadline(Duration.ofMillis(50));
      assertThrows(CallException.class, () -> setup.arm.invoke(LATER, bytes(1), brief));
      for (int i = 0; i < 20; ++i) {
        assertArrayEquals(bytes(i), setup.arm.invoke(ECHO, bytes(i)));
      }
    }
  }

  @Test
  void clientsAndServersKeepTheSchemasSizes() {
    Method<byte[], byte[]> careless =
        new Method<>("small", SMALL.id(), Kind.CALL, BYTES, BYTES);
    try (Setup setup = new Setup(Way.UDP)) {
      assertEquals(100, setup.arm.invoke(SMALL, bytes(100)).length);
      CallException kept =
          assertThrows(CallException.class, () -> setup.arm.invoke(SMALL, new byte[101]));
      assertEquals(Status.TOO_LARGE, kept.status().orElseThrow());
      assertEquals(WasRun.NO, kept.wasRun());
      assertTrue(kept.getMessage().contains("101 bytes, but the schema allows 100"));
      for (byte[] request : List.of(new byte[101], bytes(101))) {
        CallException refused =
            assertThrows(CallException.class, () -> setup.arm.invoke(careless, request));
        assertEquals(Status.TOO_LARGE, refused.status().orElseThrow());
      }
      Method<byte[], byte[]> strict =
          new Method<>(
              "small", SMALL.id(), Kind.CALL, BYTES, BYTES, 0, false, Duration.ZERO, Role.COMMAND,
              4);
      CallException received =
          assertThrows(CallException.class, () -> setup.arm.invoke(strict, bytes(5)));
      assertEquals(Status.TOO_LARGE, received.status().orElseThrow());
      assertEquals(WasRun.YES, received.wasRun());
    }
  }

  @ParameterizedTest
  @EnumSource(Way.class)
  void serversAreReachedByIpv6(Way way) {
    ServerOptions six = ServerOptions.DEFAULT.withHosts("::1");
    try (Setup setup = new Setup(way, six)) {
      assertArrayEquals(bytes(1), setup.arm.invoke(ECHO, bytes(1)));
    }
  }

  @Test
  void keysOfServersAreFoundHoweverTheirHostIsWritten() {
    PublicKey key = PrivateKey.draw().publicKey();
    Address six = Address.parse("rtpm://[::1]:7421/lab/arm0");
    Address four = Address.parse("rtpm://Arm.lab:7421/lab/arm0");
    for (String server : List.of("[::1]:7421", "[0:0:0:0:0:0:0:1]:7421", "::1", "[::1]")) {
      assertEquals(key, keyed(server, key).serverKey(six), server);
      assertEquals(null, keyed(server, key).serverKey(four), server);
    }
    for (String server : List.of("arm.lab:7421", "arm.lab")) {
      assertEquals(key, keyed(server, key).serverKey(four), server);
      assertEquals(null, keyed(server, key).serverKey(six), server);
    }
    assertEquals(null, keyed("arm.lab:7422", key).serverKey(four));
  }

  private static NodeOptions keyed(String server, PublicKey key) {
    return NodeOptions.DEFAULT.withServerKey(PrivateKey.draw(), server, key);
  }

  @Test
  void waitingCallsRunByPriority() throws Exception {
    ServerOptions one =
        ServerOptions.DEFAULT.withLanes(new ServerOptions.LaneOptions(0, 32767, 1));
    try (Setup setup = new Setup(Way.UDP, one)) {
      List<CompletableFuture<byte[]>> calls = new ArrayList<>();
      calls.add(setup.arm.call(SLOW, bytes(), CallOptions.DEFAULT.withPriority(5)));
      assertTrue(setup.lab.slowRuns.await(5, TimeUnit.SECONDS));
      for (int priority : new int[] {10, 30_000, 200}) {
        calls.add(
            setup.arm.call(SLOW, bytes(), CallOptions.DEFAULT.withPriority(priority)));
      }
      // The session answers pings itself: then the calls before it wait in the lane.
      setup.arm.ping();
      setup.lab.mayGo.countDown();
      calls.forEach(Node::await);
      assertEquals(
          List.of("slow 5", "slow 30000", "slow 200", "slow 10"), setup.lab.heard);
    }
  }

  @Test
  void callsOfTwoLanesUseTwoSessions() {
    ServerOptions two =
        ServerOptions.DEFAULT.withLanes(
            new ServerOptions.LaneOptions(0, 16_383, 1),
            new ServerOptions.LaneOptions(16_384, 32_767, 1));
    for (Way way : Way.values()) {
      try (Setup setup = new Setup(way, two)) {
        for (int priority : new int[] {3, 30_000, 100}) {
          CallOptions options = CallOptions.DEFAULT.withPriority(priority);
          assertArrayEquals(bytes(1), setup.arm.invoke(ECHO, bytes(1), options));
        }
      }
    }
  }

  @ParameterizedTest
  @EnumSource(Way.class)
  void failuresOfStreamsComeBehindTheirItems(Way way) throws Exception {
    try (Setup setup = new Setup(way)) {
      List<Integer> sizes = new ArrayList<>();
      CompletableFuture<Throwable> end = new CompletableFuture<>();
      setup
          .arm
          .stream(BREAK, bytes(1))
          .subscribe(
              new Flow.Subscriber<byte[]>() {
                @Override
                public void onSubscribe(Flow.Subscription source) {
                  source.request(Long.MAX_VALUE);
                }

                @Override
                public void onNext(byte[] item) {
                  sizes.add(item.length);
                }

                @Override
                public void onError(Throwable fault) {
                  end.complete(fault);
                }

                @Override
                public void onComplete() {
                  end.complete(null);
                }
              });
      CallException failure = (CallException) end.get(10, TimeUnit.SECONDS);
      assertEquals(Status.SERVANT_FAILED, failure.status().orElseThrow());
      assertEquals(List.of(300_000), sizes);
    }
  }

  /** Asks for items as it is told to. */
  private static final class Reader implements Flow.Subscriber<byte[]> {
    final List<Integer> items = Collections.synchronizedList(new ArrayList<>());
    final CompletableFuture<Throwable> end = new CompletableFuture<>();
    final CompletableFuture<Flow.Subscription> source = new CompletableFuture<>();
    final boolean isEager;

    Reader(boolean isEager) {
      this.isEager = isEager;
    }

    @Override
    public void onSubscribe(Flow.Subscription subscription) {
      source.complete(subscription);
      subscription.request(1);
    }

    @Override
    public void onNext(byte[] item) {
      items.add(ByteBuffer.wrap(item).getInt());
      if (isEager) {
        source.join().request(1);
      }
    }

    @Override
    public void onError(Throwable fault) {
      end.complete(fault);
    }

    @Override
    public void onComplete() {
      end.complete(null);
    }
  }

  private static byte[] number(int value, int size) {
    return ByteBuffer.allocate(size).putInt(value).array();
  }

  @ParameterizedTest
  @EnumSource(Way.class)
  void streamsArriveWholeAndInOrder(Way way) throws Exception {
    try (Setup setup = new Setup(way)) {
      Reader reader = new Reader(true);
      setup.arm.stream(WATCH, bytes()).subscribe(reader);
      while (setup.lab.items.getNumberOfSubscribers() == 0) {
        Thread.sleep(1);
      }
      List<Integer> sent = new ArrayList<>();
      for (int i = 0; i < 300; ++i) {
        setup.lab.items.submit(number(i, i % 50 == 7 ? 100_000 : 20));
        sent.add(i);
      }
      setup.lab.items.close();
      assertEquals(null, reader.end.get(10, TimeUnit.SECONDS));
      assertEquals(sent, reader.items);
    }
  }

  @ParameterizedTest
  @EnumSource(Way.class)
  void slowReadersHoldTheirServerBack(Way way) throws Exception {
    try (Setup setup = new Setup(way)) {
      Reader reader = new Reader(false);
      setup.arm.stream(WATCH, bytes()).subscribe(reader);
      while (setup.lab.items.getNumberOfSubscribers() == 0) {
        Thread.sleep(1);
      }
      for (int i = 0; i < 200; ++i) {
        setup.lab.items.submit(number(i, 20));
      }
      Thread.sleep(300);
      assertEquals(List.of(0), reader.items);
      assertTrue(
          setup.lab.items.estimateMaximumLag() > 100, "the client takes 16 items at a time");
      reader.source.join().cancel();
      while (setup.lab.items.getNumberOfSubscribers() > 0) {
        Thread.sleep(1);
      }
      assertFalse(reader.end.isDone());
    }
  }

  @ParameterizedTest
  @EnumSource(Way.class)
  void bindingsSurviveARestart(Way way) {
    Lab second = new Lab();
    try (Setup setup = new Setup(way)) {
      assertArrayEquals(bytes(1), setup.arm.invoke(ECHO, bytes(1)));
      if (way.isSealed) {
        return; // The key of the second server would be another.
      }
      int port = setup.server.port();
      setup.server.close();
      Map<String, Skeleton> objects =
          Map.of("lab/other", new Lab().skeleton(), "lab/arm0", second.skeleton());
      try (Server again = Server.open(ServerOptions.DEFAULT.withPort(port), objects)) {
        assertEquals(port, again.port());
        assertArrayEquals(bytes(1), setup.arm.invoke(COUNT, bytes()));
        assertEquals(1, second.count.get());
      }
    }
  }

  @Test
  void callsAtARestartMayHaveRunButIdempotentOnesGoOn() throws Exception {
    try (Setup setup = new Setup(Way.UDP)) {
      CompletableFuture<byte[]> idempotent = setup.arm.call(LATER, bytes(4));
      assertTrue(setup.lab.slowRuns.await(5, TimeUnit.SECONDS));
      int port = setup.server.port();
      setup.server.close();
      Lab second = new Lab();
      second.later.complete(bytes(5));
      try (Server again =
          Server.open(
              ServerOptions.DEFAULT.withPort(port), Map.of("lab/arm0", second.skeleton()))) {
        assertEquals(port, again.port());
        assertArrayEquals(bytes(5), idempotent.get(5, TimeUnit.SECONDS));
      }
    }
  }

  @Test
  void bindsThatFailSayWhy() {
    try (Setup setup = new Setup(Way.UDP)) {
      String other = setup.server.address("lab/arm1").toString();
      BindException unknown =
          assertThrows(BindException.class, () -> setup.node.bind(other, LAB));
      assertTrue(unknown.getMessage().contains("It has lab/arm0"), unknown.getMessage());
      Interface another = new Interface("lab.Other", 1, List.of());
      String address = setup.server.address("lab/arm0").toString();
      BindException wrong =
          assertThrows(BindException.class, () -> setup.node.bind(address, another));
      assertTrue(wrong.getMessage().contains("is a lab.Test"), wrong.getMessage());
      setup.server.close();
      BindException silent =
          assertThrows(
              BindException.class,
              () -> setup.node.bind(address, LAB, Duration.ofMillis(100)));
      assertNotNull(silent.getMessage());
    }
  }

  @Test
  void keysThatAreNotAdmittedAreKeptOut() {
    PrivateKey own = PrivateKey.draw();
    ServerOptions sealed =
        ServerOptions.DEFAULT.withKey(own, Set.of(PrivateKey.draw().publicKey()), false);
    try (Server server = Server.open(sealed)) {
      server.serve("lab/arm0", new Lab().skeleton());
      String address = server.address("lab/arm0").toString();
      NodeOptions stranger =
          NodeOptions.DEFAULT
              .withDeadline(Duration.ofMillis(300))
              .withServerKey(PrivateKey.draw(), "127.0.0.1", own.publicKey());
      try (Node node = Node.open(stranger);
          Node unsealed = Node.open()) {
        assertThrows(
            BindException.class, () -> node.bind(address, LAB, Duration.ofMillis(300)));
        BindException refused =
            assertThrows(BindException.class, () -> unsealed.bind(address, LAB));
        assertTrue(refused.getMessage().contains("not_allowed"), refused.getMessage());
      }
    }
  }

  @Test
  void callbacksThatWaitFailInsteadOfHanging() {
    try (Setup setup = new Setup(Way.UDP)) {
      CompletableFuture<byte[]> nested =
          setup.arm.call(SLOW, bytes()).thenApply(reply -> setup.arm.invoke(ECHO, reply));
      setup.lab.mayGo.countDown();
      Exception fault = assertThrows(Exception.class, () -> Node.await(nested));
      assertTrue(fault.getMessage().contains("thenCompose"), fault.getMessage());
      assertArrayEquals(bytes(3), setup.arm.invoke(ECHO, bytes(3)));
    }
  }

  @Test
  void hostilePeersCostTheirConnectionOnly() throws Exception {
    try (Setup setup = new Setup(Way.TCP)) {
      Random random = new Random(1);
      InetAddress here = InetAddress.getLoopbackAddress();
      int port = setup.server.port();
      try (DatagramSocket socket = new DatagramSocket()) {
        for (int i = 0; i < 300; ++i) {
          byte[] junk = new byte[random.nextInt(200)];
          random.nextBytes(junk);
          if (i % 2 == 0 && junk.length > 4) {
            System.arraycopy("HP\1".getBytes(StandardCharsets.US_ASCII), 0, junk, 0, 3);
            junk[3] = (byte) random.nextInt(12);
          }
          socket.send(new DatagramPacket(junk, junk.length, here, port));
        }
      }
      for (int i = 0; i < 20; ++i) {
        try (Socket socket = new Socket(here, port)) {
          byte[] junk = new byte[500];
          random.nextBytes(junk);
          socket.getOutputStream().write(junk);
          assertEquals(-1, socket.getInputStream().read(), "the server hangs up");
        }
      }
      assertTrue(setup.server.dropped("bad_magic") >= 20);
      assertArrayEquals(bytes(3), setup.arm.invoke(ECHO, bytes(3)));
    }
  }
}

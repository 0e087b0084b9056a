package org.rtpm.live;

import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;
import static org.rtpm.BytesCodec.BYTES;

import java.nio.file.Path;
import java.time.Duration;
import java.util.EnumSet;
import java.util.List;
import java.util.Map;
import java.util.Set;
import java.util.concurrent.BlockingQueue;
import java.util.concurrent.LinkedBlockingQueue;
import java.util.concurrent.TimeUnit;
import org.junit.jupiter.api.BeforeAll;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.Timeout;
import org.junit.jupiter.api.io.TempDir;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.EnumSource;
import org.rtpm.BindException;
import org.rtpm.Binding;
import org.rtpm.CallException;
import org.rtpm.CallOptions;
import org.rtpm.Device;
import org.rtpm.DeviceException;
import org.rtpm.DeviceLease;
import org.rtpm.Event;
import org.rtpm.EventConsumer;
import org.rtpm.EventFilter;
import org.rtpm.EventSupplier;
import org.rtpm.Fault;
import org.rtpm.Lifecycle;
import org.rtpm.NameException;
import org.rtpm.Node;
import org.rtpm.NodeOptions;
import org.rtpm.PreparedCall;
import org.rtpm.PrivateKey;
import org.rtpm.Registration;
import org.rtpm.RtpmException;
import org.rtpm.Server;
import org.rtpm.ServerOptions;
import org.rtpm.Status;
import org.rtpm.Transport;
import org.rtpm.interop.InteropServer;
import org.rtpm.values.Interface;
import org.rtpm.values.Kind;
import org.rtpm.values.Method;
import org.rtpm.values.Operation;
import org.rtpm.values.Skeleton;
import rtpm.Trial;
import rtpm.TrialPhase;
import rtpm.device.DeviceClient;
import rtpm.device.DeviceMethods;
import rtpm.device.Sample;
import rtpm.device.Vector3;
import rtpm.interop.Count;
import rtpm.interop.InteropClient;
import rtpm.interop.InteropMethods;
import rtpm.introspection.IntrospectionClient;
import rtpm.introspection.IntrospectionMethods;
import rtpm.introspection.ObjectEntry;
import rtpm.names.OutcomeCode;

/** With RTPM's programs in C++: registry, devices, tool. */
@Timeout(60)
class LiveTest {
  private static final Method<byte[], byte[]> WHO =
      new Method<>("who", 1, Kind.CALL, BYTES, BYTES);
  private static final Interface LAB = new Interface("lab.Test", 77, List.of(WHO));

  @TempDir Path home;

  @BeforeAll
  static void needsPrograms() {
    Program.assumeBuilt("rtpm-registryd", "rtpm-deviced", "rtpm");
  }

  private Program registry() throws Exception {
    return Program.start(home, "rtpm-registryd", "--port", "0");
  }

  private static Server server(int port, int who) {
    Skeleton skeleton =
        new Skeleton(
            LAB, List.of(new Operation.Plain<>(WHO, (bytes, context) -> new byte[] {(byte) who})));
    return Server.open(ServerOptions.DEFAULT.withPort(port), Map.of("lab/test", skeleton));
  }

  @Test
  void namesAreBoundFollowedAndUnbound() throws Exception {
    try (Program registry = registry()) {
      String url = registry.address();
      NodeOptions options =
          NodeOptions.DEFAULT.withRegistries("127.0.0.1:1", url);
      Server first = server(0, 1);
      try (Node node = Node.open(options)) {
        NameException unknown =
            assertThrows(NameException.class, () -> node.bind("lab/test", LAB));
        assertEquals(OutcomeCode.NOT_FOUND, unknown.outcome());
        Registration name =
            Registration.create(node, "lab/test", first.address("lab/test"), "lab.Test");
        try (Program tool = Program.start(home, "rtpm", "list", "--registry", url)) {
          String listed = tool.all();
          assertTrue(listed.contains("lab/test"), listed);
        }
        Binding test = node.bind("lab/test", LAB, Duration.ofSeconds(5));
        assertArrayEquals(new byte[] {1}, test.invoke(WHO, new byte[0]));
        // Longer than the lease, which is renewed.
        Thread.sleep(2500);
        assertEquals("lab/test", node.directory().list("").get(0).name());
        name.close();
        first.close();
        try (Server second = server(0, 2);
            Registration again =
                Registration.create(
                    node, "lab/test", second.address("lab/test"), "lab.Test")) {
          assertArrayEquals(new byte[] {2}, callUntilItWorks(test));
          assertEquals(second.address("lab/test"), test.address());
          assertEquals("", again.trouble());
        }
        assertThrows(NameException.class, () -> node.directory().resolve("lab/test"));
      }
    }
  }

  private String tool(String... arguments) throws Exception {
    try (Program tool = Program.start(home, "rtpm", arguments)) {
      return tool.all();
    }
  }

  @Test
  void toolsCallServersByTheirSchemas() throws Exception {
    try (Server server = Server.open()) {
      server.serve("lab/interop", InteropServer.servant());
      String url = server.address("lab/interop").toString();
      String told = tool("info", url);
      assertTrue(told.contains("rtpm.interop.Interop"), told);
      assertTrue(told.contains("count_up (stream)"), told);
      String schema = tool("info", url, "--schema");
      assertTrue(schema.contains("rpc_service Interop"), schema);
      tool("call", url, "add", "{count: 5}");
      String sum = tool("call", url, "add", "{count: 2}");
      assertTrue(sum.contains("\"count\": 7"), sum);
      String items = tool("call", url, "count_up", "{count: 3}");
      assertTrue(items.contains("\"number\": 2"), items);
    }
  }

  @Test
  void grantsOfTheToolAreKept() throws Exception {
    PrivateKey own = PrivateKey.draw();
    PrivateKey alice = PrivateKey.draw();
    Path file = home.resolve("authorized");
    String key = alice.publicKey().toString();
    tool(
        "key", "authorize", key, "--name", "alice", "--role", "command", "--on", "lab/**",
        "--max-priority", "100", "--file", file.toString());
    tool("key", "authorize", "anonymous", "--role", "observe", "--on", "public/*", "--file",
        file.toString());
    ServerOptions options = ServerOptions.DEFAULT.withAuthorized(own, file);
    try (Server server = Server.open(options)) {
      server.serve("lab/interop", InteropServer.servant());
      server.serve("public/interop", InteropServer.servant());
      server.serve("secret/interop", InteropServer.servant());
      NodeOptions sealed =
          NodeOptions.DEFAULT.withServerKey(
              alice, "127.0.0.1:" + server.port(), own.publicKey());
      try (Node node = Node.open(sealed);
          Node stranger = Node.open()) {
        InteropClient lab = client(node, server, "lab/interop");
        assertEquals(3, Node.await(lab.add(new Count(3))).count());
        CallException urgent =
            assertThrows(
                CallException.class,
                () -> Node.await(lab.notes(CallOptions.DEFAULT.withPriority(101))));
        assertEquals(Status.PRIORITY_NOT_ALLOWED, urgent.status().orElseThrow());
        BindException hidden =
            assertThrows(BindException.class, () -> client(node, server, "secret/interop"));
        assertTrue(hidden.getMessage().contains("no object secret/interop. It has lab/interop"));
        InteropClient open = client(stranger, server, "public/interop");
        CallException refused =
            assertThrows(CallException.class, () -> Node.await(open.add(new Count(1))));
        assertEquals(Status.NOT_ALLOWED, refused.status().orElseThrow());
        IntrospectionClient catalog =
            new IntrospectionClient(
                stranger.bind(
                    server.address("rtpm/introspection").toString(),
                    IntrospectionMethods.INTERFACE));
        assertEquals(
            List.of("public/interop"),
            Node.await(catalog.list()).objects().stream().map(ObjectEntry::path).toList());

        tool("key", "revoke", key, "--file", file.toString());
        Thread.sleep(1000);
        assertThrows(RtpmException.class, () -> Node.await(lab.add(new Count(3))));
      }
    }
  }

  private static InteropClient client(Node node, Server server, String path) {
    return new InteropClient(
        node.bind(server.address(path).toString(), InteropMethods.INTERFACE));
  }

  private static byte[] callUntilItWorks(Binding test) throws InterruptedException {
    while (true) {
      try {
        return test.invoke(
            WHO, new byte[0], CallOptions.DEFAULT.withDeadline(Duration.ofMillis(300)));
      } catch (RtpmException e) {
        Thread.sleep(50);
      }
    }
  }

  @Test
  void secondServersDoNotGetTheName() throws Exception {
    try (Program registry = registry();
        Node node = Node.open(NodeOptions.DEFAULT.withRegistries(registry.address()));
        Server first = server(0, 1);
        Server second = server(0, 2);
        Registration held =
            Registration.create(node, "lab/test", first.address("lab/test"), "lab.Test")) {
      NameException taken =
          assertThrows(
              NameException.class,
              () ->
                  Registration.create(
                      node, "lab/test", second.address("lab/test"), "lab.Test"));
      assertEquals(OutcomeCode.ALREADY_BOUND, taken.outcome());
      assertTrue(taken.getMessage().contains(first.address("lab/test").toString()));
      assertEquals("", held.trouble());
    }
  }

  @ParameterizedTest
  @EnumSource(Transport.class)
  void devicesAreReadByName(Transport transport) throws Exception {
    try (Laboratory laboratory = Laboratory.start(home);
        Node node = Node.open(laboratory.options().withTransport(transport))) {
      DeviceClient arm = new DeviceClient(node.bind("lab/arm0", DeviceMethods.INTERFACE));
      assertTrue(Node.await(arm.describe()).toString().contains("sim"));
      CallOptions patient = CallOptions.DEFAULT.withDeadline(Duration.ofSeconds(5));
      Sample before = Node.await(arm.read(patient));
      Sample after = Node.await(arm.read(patient));
      while (after.sequence() == before.sequence()) {
        after = Node.await(arm.read(patient));
      }
      assertTrue(after.sequence() > before.sequence());
      assertTrue(Double.isFinite(after.positionM().x()));
      try (Binding same = node.bind("lab/arm0", DeviceMethods.INTERFACE)) {
        PreparedCall read = same.prepare(DeviceMethods.READ, patient);
        Sample.View sample = new Sample.View().wrap(read.reply(), 0);
        read.run();
        assertTrue(sample.sequence() >= after.sequence());
        assertTrue(Double.isFinite(sample.positionM().x()));
      }
    }
  }

  private static Trial trial(long number) {
    return Trial.builder().phase(TrialPhase.BEGIN).number(number).condition("soft").build();
  }

  @Test
  void eventsGoBothWays() throws Exception {
    try (Program registry = registry()) {
      String url = registry.address();
      try (Program hub = Program.start(home, "rtpm-eventd", "--registry", url, "--port", "0");
          Node node =
              Node.open(
                  NodeOptions.DEFAULT
                      .withRegistries(url)
                      .withDeadline(Duration.ofSeconds(5)))) {
        hub.address();
        BlockingQueue<Event> some = new LinkedBlockingQueue<>();
        EventFilter later =
            EventFilter.where(
                Trial.EVENT, "number", EventFilter.Comparison.GREATER_OR_EQUAL, 5);
        try (EventConsumer consumer =
                EventConsumer.open(node, "rtpm/events", "test", later, some::add);
            EventSupplier supplier =
                EventSupplier.open(node, "rtpm/events", "test", Trial.EVENT)) {
          assertEquals("", consumer.trouble());
          IllegalArgumentException refused =
              assertThrows(
                  IllegalArgumentException.class,
                  () ->
                      EventConsumer.open(
                          node, "rtpm/events", "test", EventFilter.all(), some::add));
          assertTrue(refused.getMessage().contains("no children"), refused.getMessage());
          for (int i = 3; i < 8; ++i) {
            supplier.push(Trial.EVENT, 9, trial(i));
          }
          for (int i = 5; i < 8; ++i) {
            Event event = some.poll(5, TimeUnit.SECONDS);
            assertEquals(i, event.value(Trial.EVENT).number());
            assertEquals(9, event.source());
            assertEquals(i - 2, event.sequence());
            assertTrue(event.sentNs() >= event.originNs());
          }
          assertEquals(5, supplier.counts().taken());
          assertEquals(0, consumer.lost() + consumer.malformed());
          try (Program echo =
              Program.start(
                  home, "rtpm", "echo", "--registry", url, "--count", "1", "--for", "5s")) {
            Thread.sleep(500);
            supplier.push(Trial.EVENT, 9, trial(42));
            String printed = echo.all();
            assertTrue(printed.contains("42") && printed.contains("soft"), printed);
          }
        }
      }
    }
  }

  // A command has 10 ms, which a busy machine may take for itself.
  static void patiently(Runnable command) {
    for (int i = 0; i < 50; ++i) {
      try {
        command.run();
        return;
      } catch (CallException e) {
        assertTrue(e.status().isEmpty() || e.status().get() == Status.EXPIRED, e.getMessage());
      }
    }
    throw new AssertionError("no command arrived in time");
  }

  private static void push(DeviceLease lease, Vector3 force) {
    patiently(() -> lease.force(force, Duration.ofMillis(20)));
  }

  @Test
  void oneClientAtATimeCommandsADevice() throws Exception {
    try (Laboratory laboratory = Laboratory.start(home);
        Node node = laboratory.node();
        Node other = laboratory.node()) {
      try (Device arm = Device.open(node, "lab/arm0");
          Device same = Device.open(other, "lab/arm0")) {
        Vector3 down = new Vector3(0, 0, -1);
        try (DeviceLease lease = arm.acquire(Duration.ofSeconds(1))) {
          push(lease, down);
          push(lease, down);
          DeviceException held =
              assertThrows(DeviceException.class, () -> same.acquire(Duration.ofMillis(200)));
          assertEquals(rtpm.device.OutcomeCode.HELD, held.outcome());
          same.emergencyStop();
          DeviceException stopped =
              assertThrows(DeviceException.class, () -> push(lease, down));
          assertEquals(rtpm.device.OutcomeCode.EMERGENCY_STOP, stopped.outcome());
          lease.rearm();
          push(lease, down);
          assertEquals("", lease.trouble());
        }
        try (DeviceLease lease = same.acquire(Duration.ofSeconds(2))) {
          push(lease, down);
          Thread.sleep(1500); // Longer than a lease without renewals.
          push(lease, down);
        }
      }
    }
  }

  @Test
  void latchesAreGoneWhenTheirCallsReturn() throws Exception {
    try (Laboratory laboratory = Laboratory.start(home);
        Node node = laboratory.node();
        Device arm = Device.open(node, "lab/arm0")) {
      Vector3 broken = new Vector3(Double.NaN, 0, 0);
      for (int i = 0; i < 10; ++i) {
        DeviceLease lease = arm.acquire(Duration.ofSeconds(2));
        DeviceException refused =
            assertThrows(DeviceException.class, () -> push(lease, broken));
        assertEquals(rtpm.device.OutcomeCode.NOT_FINITE, refused.outcome());
        awaitFault(arm, Fault.COMMAND_NOT_FINITE);
        lease.recover();
        assertFalse(faults(arm).contains(Fault.COMMAND_NOT_FINITE));
        lease.deactivate();
        assertEquals(Lifecycle.INACTIVE, Lifecycle.of(arm.read().lifecycle()));
        lease.activate();
        assertEquals(Lifecycle.ACTIVE, Lifecycle.of(arm.read().lifecycle()));
        arm.emergencyStop();
        lease.rearm();
        // The end of the lease would undo what the device has not taken up.
        lease.close();
        assertFalse(faults(arm).contains(Fault.EMERGENCY_STOP));
      }
    }
  }

  @Test
  void filtersShowInFaultsOnly() throws Exception {
    try (Laboratory laboratory = Laboratory.start(home);
        Node node = laboratory.node();
        Device arm = Device.open(node, "lab/arm0");
        DeviceLease lease = arm.acquire(Duration.ofSeconds(2))) {
      Vector3 tooMuch = new Vector3(0, 0, 1000);
      assertTrue(seen(arm, lease, tooMuch).contains(Fault.FORCE_CLAMPED));
      assertTrue(arm.read().forceNewton().z() <= arm.describe().forceNewtonMax());
      assertThrows(
          DeviceException.class, () -> push(lease, new Vector3(0, Double.NaN, 0)));
      // A newer command within the same cycle would replace it.
      awaitFault(arm, Fault.COMMAND_NOT_FINITE);
      assertTrue(seen(arm, lease, new Vector3(0, 0, 1)).contains(Fault.COMMAND_NOT_FINITE));
      assertEquals(new Vector3(0, 0, 0), arm.read().forceNewton());
    }
  }

  private static void awaitFault(Device arm, Fault fault) throws Exception {
    while (!faults(arm).contains(fault)) {
      Thread.sleep(1);
    }
  }

  private static Set<Fault> faults(Device arm) {
    return Fault.of(arm.read().faults());
  }

  // A hold above the device's limit is no error.
  private static Set<Fault> seen(Device arm, DeviceLease lease, Vector3 force) throws Exception {
    Set<Fault> all = EnumSet.noneOf(Fault.class);
    for (int i = 0; i < 20; ++i) {
      patiently(() -> lease.force(force, Duration.ofSeconds(10)));
      Thread.sleep(5);
      all.addAll(faults(arm));
    }
    return all;
  }
}

package org.rtpm;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import com.sun.management.ThreadMXBean;
import java.lang.management.ManagementFactory;
import java.time.Duration;
import java.util.Map;
import java.util.Set;
import java.util.stream.Collectors;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.Timeout;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.EnumSource;
import org.rtpm.interop.InteropServer;
import rtpm.interop.InteropMethods;
import rtpm.interop.Numbers;

/** Calls that are made again and again. */
@Timeout(60)
class PreparedCallTest {
  private static final CallOptions PATIENT =
      CallOptions.DEFAULT.withDeadline(Duration.ofSeconds(10));
  private static final int WARM_UP_COUNT = 3_000;
  private static final int CALL_COUNT = 10_000;
  /** For the JDK's own queue of a contended lock, and its map of a selector's sockets. */
  private static final long BYTES_MAX = 32_000;

  private static Set<Thread> threads() {
    return Thread.getAllStackTraces().keySet().stream()
        .filter(thread -> thread.getName().equals("rtpm-node"))
        .collect(Collectors.toSet());
  }

  private static Server server(int port) {
    return Server.open(
        ServerOptions.DEFAULT.withPort(port),
        Map.of("interop", InteropServer.servant().skeleton()));
  }

  private static void callSome(PreparedCall call, Numbers.View sent, Numbers.View got, int count) {
    for (int i = 0; i < count; ++i) {
      sent.i32(i).f64(0.5 * i);
      sent.at().z(i);
      call.run();
      if (got.i32() != i || got.f64() != 0.5 * i || got.at().z() != i) {
        throw new AssertionError("another reply than that of call " + i);
      }
    }
  }

  @ParameterizedTest
  @EnumSource(Transport.class)
  void repliesAreThoseOfTheRequests(Transport transport) {
    Server server = server(0);
    try (Node node = Node.open(NodeOptions.DEFAULT.withTransport(transport));
        Binding object =
            node.bind(server.address("interop").toString(), InteropMethods.INTERFACE)) {
      PreparedCall call = object.prepare(InteropMethods.ECHO_NUMBERS, PATIENT);
      Numbers.View sent = new Numbers.View().wrap(call.request(), 0);
      Numbers.View got = new Numbers.View().wrap(call.reply(), 0);
      callSome(call, sent, got, 50);
      assertEquals(sent.toRecord(), got.toRecord());
      // Others go beside it.
      assertEquals(
          got.toRecord(), object.invoke(InteropMethods.ECHO_NUMBERS, got.toRecord(), PATIENT));
      assertThrows(
          IllegalArgumentException.class,
          () -> object.prepare(InteropMethods.ECHO_VALUES, PATIENT));
      CallOptions brief = CallOptions.DEFAULT.withDeadline(Duration.ofMillis(200));
      PreparedCall late = object.prepare(InteropMethods.ECHO_NUMBERS, brief);
      server.close();
      CallException failure = assertThrows(CallException.class, late::run);
      assertTrue(failure.getMessage().contains("echo_numbers"), failure.getMessage());
      assertEquals(0, late.reply().getInt(0));
      try (Server next = server(server.port())) {
        callSome(call, sent, got, 20);
        assertEquals(server.port(), next.port());
      }
    } finally {
      server.close();
    }
  }

  @Test
  void loopsMakeNoGarbage() {
    Set<Thread> before = threads();
    try (Server server = server(0);
        Node node = Node.open();
        Binding object =
            node.bind(server.address("interop").toString(), InteropMethods.INTERFACE)) {
      Set<Thread> own = threads();
      own.removeAll(before);
      long reader = own.iterator().next().getId();
      long caller = Thread.currentThread().getId();
      PreparedCall call = object.prepare(InteropMethods.ECHO_NUMBERS, PATIENT);
      Numbers.View sent = new Numbers.View().wrap(call.request(), 0);
      Numbers.View got = new Numbers.View().wrap(call.reply(), 0);
      callSome(call, sent, got, WARM_UP_COUNT);
      ThreadMXBean bean = (ThreadMXBean) ManagementFactory.getThreadMXBean();
      long ofCaller = bean.getThreadAllocatedBytes(caller);
      long ofReader = bean.getThreadAllocatedBytes(reader);
      callSome(call, sent, got, CALL_COUNT);
      ofCaller = bean.getThreadAllocatedBytes(caller) - ofCaller;
      ofReader = bean.getThreadAllocatedBytes(reader) - ofReader;
      assertTrue(ofCaller <= BYTES_MAX, "the calling thread allocated " + ofCaller + " bytes");
      assertTrue(ofReader <= BYTES_MAX, "the node's thread allocated " + ofReader + " bytes");
    }
  }
}

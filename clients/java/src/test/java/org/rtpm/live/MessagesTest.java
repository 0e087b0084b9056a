package org.rtpm.live;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.nio.file.Path;
import java.time.Duration;
import org.junit.jupiter.api.BeforeAll;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.Timeout;
import org.junit.jupiter.api.function.Executable;
import org.junit.jupiter.api.io.TempDir;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.ValueSource;
import org.rtpm.BindException;
import org.rtpm.Binding;
import org.rtpm.CallException;
import org.rtpm.Device;
import org.rtpm.DeviceException;
import org.rtpm.DeviceLease;
import org.rtpm.NameException;
import org.rtpm.Node;
import org.rtpm.NodeOptions;
import rtpm.device.DeviceMethods;
import rtpm.device.Quaternion;
import rtpm.device.Vector3;
import rtpm.names.OutcomeCode;

/** The words of failures: the thing, the cause, the remedy. */
@Timeout(60)
class MessagesTest {
  @TempDir Path home;

  @BeforeAll
  static void needsPrograms() {
    Program.assumeBuilt("rtpm-registryd", "rtpm-deviced");
  }

  private Program registry() throws Exception {
    return Program.start(home, "rtpm-registryd", "--port", "0");
  }

  // Ahead of its scope's end.
  private static void end(Program program) {
    program.close();
  }

  private static Node node(String registry) {
    return Node.open(
        NodeOptions.DEFAULT.withRegistries(registry).withDeadline(Duration.ofSeconds(5)));
  }

  private static String authority(String url) {
    return url.substring("rtpm://".length(), url.indexOf("/rtpm/names"));
  }

  private static <T extends Throwable> T fails(
      Class<T> type, Executable attempt, String... words) {
    T failure = assertThrows(type, attempt);
    for (String each : words) {
      assertTrue(failure.getMessage().contains(each), failure.getMessage());
    }
    return failure;
  }

  @Test
  void unknownNamesSayWhichRegistryWasAsked() throws Exception {
    try (Program registry = registry()) {
      String url = registry.address();
      // The first one does not answer.
      NodeOptions options = NodeOptions.DEFAULT.withRegistries("127.0.0.1:1", url);
      try (Node node = Node.open(options)) {
        fails(
            NameException.class,
            () -> Device.open(node, "lab/arm7"),
            "'lab/arm7'",
            "the registry at " + authority(url) + ".",
            "node.directory().list(\"\")",
            "`rtpm list`");
      }
    }
  }

  @Test
  void malformedNamesSayTheRule() throws Exception {
    try (Program registry = registry();
        Node node = node(registry.address())) {
      NameException bad =
          fails(
              NameException.class,
              () -> Device.open(node, "lab/arm 0"),
              "'lab/arm 0'",
              "1 to 8 components of letters, digits, '.', '_' and '-'");
      assertEquals(OutcomeCode.BAD_NAME, bad.outcome());
    }
  }

  @Test
  void silentRegistriesSayHowToStartOne() throws Exception {
    String[] words = {
      "the registry rtpm://127.0.0.1:", "rtpm-registryd", "RTPM_REGISTRY",
      "NodeOptions.withRegistries"
    };
    NodeOptions brief = NodeOptions.DEFAULT.withDeadline(Duration.ofMillis(300));
    try (Node node = Node.open(brief.withRegistries("127.0.0.1:1"))) {
      fails(BindException.class, () -> node.directory().list(""), words);
    }
    try (Program registry = registry();
        Node node = Node.open(brief.withRegistries(registry.address()))) {
      node.directory().list("");
      end(registry);
      fails(CallException.class, () -> node.directory().list(""), words);
    }
  }

  @ParameterizedTest
  @ValueSource(
      strings = {"%s", "rtpm://%s", "rtpm://%s/rtpm/names", "rtpm://127.0.0.1:1,rtpm://%s"})
  void registriesHaveSeveralForms(String form) throws Exception {
    try (Program registry = registry();
        Node node = node(String.format(form, authority(registry.address())))) {
      assertEquals(0, node.directory().list("").size());
    }
  }

  @ParameterizedTest
  @ValueSource(strings = {"", "http://a:1", "::1", "a:1/rtpm/names", "a:99999", "rtpm://a:1/"})
  void otherRegistriesAreRefused(String text) {
    try (Node node = Node.open(NodeOptions.DEFAULT.withRegistries(text))) {
      fails(
          IllegalArgumentException.class,
          () -> node.directory().list(""),
          "'" + text + "' is no registry",
          "host, host:port, [IPv6]:port or rtpm://host:port/rtpm/names");
    }
  }

  @Test
  void portsOfRegistriesMayBeLeftOut() {
    for (String text : new String[] {"host.invalid", "rtpm://host.invalid"}) {
      try (Node node = Node.open(NodeOptions.DEFAULT.withRegistries(text))) {
        fails(
            BindException.class,
            () -> node.directory().list(""),
            "the registry rtpm://host.invalid:7420/rtpm/names");
      }
    }
  }

  @Test
  void devicesSayTheirNameAndTheRemedy() throws Exception {
    try (Laboratory laboratory = Laboratory.start(home);
        Node node = laboratory.node()) {
      try (Device arm = Device.open(node, "lab/arm0")) {
        DeviceLease lease = arm.acquire(Duration.ofSeconds(1));
        Vector3 zero = new Vector3(0, 0, 0);
        Quaternion upright = new Quaternion(0, 0, 0, 1);
        Duration hold = Duration.ofMillis(20);
        Executable command = () -> LiveTest.patiently(() -> lease.force(zero, hold));
        fails(
            DeviceException.class,
            () -> LiveTest.patiently(() -> lease.pose(zero, upright, hold)),
            "lab/arm0: command: ",
            "describe().modes()");
        arm.emergencyStop();
        fails(DeviceException.class, command, "lab/arm0: command: ", "lease.rearm()");
        lease.rearm();
        lease.close();
        fails(DeviceException.class, command, "lab/arm0: command: ", "acquire the device");
        end(laboratory.devices());
        fails(CallException.class, arm::describe, "lab/arm0 at 127.0.0.1:");
      }
    }
  }

  @Test
  void closedNodesSaySo() throws Exception {
    try (Laboratory laboratory = Laboratory.start(home)) {
      Node node = laboratory.node();
      Device arm = Device.open(node, "lab/arm0");
      DeviceLease lease = arm.acquire(Duration.ofSeconds(1));
      Binding binding = node.bind("lab/arm0", DeviceMethods.INTERFACE);
      node.close();
      String url = laboratory.options().registries().get(0);
      String closed = "the node is closed";
      fails(IllegalStateException.class, arm::read, closed);
      fails(IllegalStateException.class, binding::ping, closed);
      fails(IllegalStateException.class, () -> Device.open(node, "lab/arm0"), closed);
      fails(IllegalStateException.class, () -> Device.open(node, url), closed);
      fails(IllegalStateException.class, () -> node.directory().list(""), closed);
      lease.close();
      assertTrue(lease.trouble().contains(closed), lease.trouble());
      arm.close();
    }
  }
}

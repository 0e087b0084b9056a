package org.rtpm.live;

import java.io.IOException;
import java.nio.file.Path;
import java.time.Duration;
import org.rtpm.Node;
import org.rtpm.NodeOptions;

/** RTPM's registry and, bound there, the simulated arm as lab/arm0. */
final class Laboratory implements AutoCloseable {
  private final Program registry;
  private final NodeOptions options;
  private Program devices;

  private Laboratory(Program registry) throws IOException {
    this.registry = registry;
    options =
        NodeOptions.DEFAULT
            .withRegistries(registry.address())
            .withDeadline(Duration.ofSeconds(5));
  }

  /**
   * Starts both, and waits until the arm is served.
   *
   * @param home as that of {@link Program#start}
   */
  static Laboratory start(Path home) throws IOException {
    Laboratory laboratory = new Laboratory(Program.start(home, "rtpm-registryd", "--port", "0"));
    try {
      laboratory.startDevices(home);
      return laboratory;
    } catch (IOException e) {
      laboratory.close();
      throw e;
    }
  }

  private void startDevices(Path home) throws IOException {
    devices =
        Program.start(
            home,
            "rtpm-deviced",
            "--registry",
            options.registries().get(0),
            "--events",
            "none",
            "--stops",
            "none",
            "--settings",
            "");
    devices.address();
  }

  /** The options of a node beside it, patient as a busy machine needs. */
  NodeOptions options() {
    return options;
  }

  Program devices() {
    return devices;
  }

  Node node() {
    return Node.open(options);
  }

  @Override
  public void close() {
    if (devices != null) {
      devices.close();
    }
    registry.close();
  }
}

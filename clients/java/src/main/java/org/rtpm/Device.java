package org.rtpm;

import java.time.Duration;
import java.util.Map;
import org.rtpm.internal.io.ClientLoop;
import rtpm.device.Description;
import rtpm.device.DeviceClient;
import rtpm.device.DeviceMethods;
import rtpm.device.Lease;
import rtpm.device.Outcome;
import rtpm.device.OutcomeCode;
import rtpm.device.Sample;
import rtpm.device.Stop;
import rtpm.device.StopScope;

/**
 * A device of the laboratory: its samples, the right to command it, and its emergency stop.
 *
 * <p>Every function waits for its answer. Threads: any.
 */
public final class Device implements AutoCloseable {
  /** A device grants a lease at most every 100 ms. */
  private static final long ACQUIRE_INTERVAL_MS = 50;

  private static final Map<OutcomeCode, String> MEANINGS =
      Map.of(
          OutcomeCode.NOT_HOLDER,
          "this client does not hold the lease, or no longer; acquire the device again",
          OutcomeCode.HELD,
          "another client has the lease; wait until it ends",
          OutcomeCode.TOO_SOON,
          "the lease has changed a moment ago; try again in a second",
          OutcomeCode.NOT_ACTIVE,
          "the device is not active; call lease.activate(), or wait until it is back",
          OutcomeCode.SUPERSEDED,
          "a newer command of this lease came first",
          OutcomeCode.NOT_FINITE,
          "the command has a NaN or an infinity; correct it, then call lease.recover()",
          OutcomeCode.TOO_MANY,
          "too many commands at once; send them from fewer threads",
          OutcomeCode.WRONG_MODE,
          "the device takes no commands of this mode; describe().modes() has those that it takes",
          OutcomeCode.EMERGENCY_STOP,
          "an emergency stop is in force; remove its cause, then call lease.rearm()");

  private final String name;
  private final Binding binding;
  private final DeviceClient client;
  private final CallOptions patient;

  private Device(Node node, String name) {
    this.name = name;
    binding = node.bind(name, DeviceMethods.INTERFACE);
    patient = CallOptions.DEFAULT.withDeadline(node.options().deadline());
    client = new DeviceClient(binding);
  }

  /**
   * Opens a device.
   *
   * @param name such as {@code lab/arm0}, or its address
   * @throws RtpmException if it can't be bound
   * @throws NameException if its name is not bound
   */
  public static Device open(Node node, String name) {
    return new Device(node, name);
  }

  /** As it was opened. */
  String name() {
    return name;
  }

  /** All of its methods, without waiting. */
  public DeviceClient client() {
    return client;
  }

  /** Its description: axes, limits, units. */
  public Description describe() {
    return Node.await(client.describe());
  }

  /**
   * Its newest sample; sequence 0: it has none yet. Waits for the node's deadline: the schema's 10
   * ms are for loops, and shorter than some pauses of a JVM.
   */
  public Sample read() {
    return Node.await(client.read(patient));
  }

  /**
   * Acquires the right to command the device, and waits while another client has it.
   *
   * @param patience how long
   * @throws DeviceException with HELD if another client kept it
   */
  public DeviceLease acquire(Duration patience) {
    long end = Node.after(patience);
    while (true) {
      Lease lease = Node.await(client.acquire());
      OutcomeCode outcome = lease.outcome();
      if (outcome.equals(OutcomeCode.DONE)) {
        return new DeviceLease(this, lease, describe().holdUsMax());
      }
      boolean mayChange =
          outcome.equals(OutcomeCode.HELD) || outcome.equals(OutcomeCode.TOO_SOON);
      if (!mayChange || ClientLoop.now() >= end) {
        throw failure("acquire", outcome);
      }
      try {
        Thread.sleep(ACQUIRE_INTERVAL_MS);
      } catch (InterruptedException e) {
        Thread.currentThread().interrupt();
        throw failure("acquire", outcome);
      }
    }
  }

  /**
   * Takes the force of the device away at once, until {@link DeviceLease#rearm}. Needs no lease.
   */
  public void emergencyStop() {
    expectDone("emergency_stop", Node.await(client.emergencyStop(new Stop(StopScope.DEVICE))));
  }

  void expectDone(String method, Outcome outcome) {
    if (!outcome.code().equals(OutcomeCode.DONE)) {
      throw failure(method, outcome.code());
    }
  }

  private DeviceException failure(String method, OutcomeCode outcome) {
    String meaning = MEANINGS.get(outcome);
    return new DeviceException(
        Printable.of(name) + ": " + method + ": " + (meaning == null ? outcome : meaning),
        outcome);
  }

  /** Gives the device up; leases are to be closed before. */
  @Override
  public void close() {
    binding.close();
  }
}

package org.rtpm;

import java.time.Duration;
import java.util.concurrent.CompletableFuture;
import java.util.concurrent.Executors;
import java.util.concurrent.ScheduledExecutorService;
import java.util.concurrent.TimeUnit;
import java.util.concurrent.atomic.AtomicLong;
import java.util.function.Predicate;
import org.rtpm.internal.io.ClientLoop;
import rtpm.device.Command;
import rtpm.device.CommandMode;
import rtpm.device.Holder;
import rtpm.device.Lease;
import rtpm.device.Outcome;
import rtpm.device.Quaternion;
import rtpm.device.Sample;
import rtpm.device.Vector3;

/**
 * The right to command a device. It is renewed until it is closed; without commands the device ends
 * it after some seconds all the same.
 *
 * <p>A command holds for the time that it states: if no newer one comes, the device takes the force
 * away. So a program that stops, or that the garbage collector pauses for longer, moves nothing.
 *
 * <p>Threads: any.
 */
public final class DeviceLease implements AutoCloseable {
  private static final Vector3 ZERO = new Vector3(0, 0, 0);
  private static final Quaternion UPRIGHT = new Quaternion(0, 0, 0, 1);
  private static final int JOINT_COUNT = 8;
  private static final Duration LATCH_PATIENCE = Duration.ofMillis(500);
  /** To activate, a driver may have to find and open its device. */
  private static final Duration DRIVER_PATIENCE = Duration.ofSeconds(5);
  private static final long READ_INTERVAL_MS = 2;

  private final Device device;
  private final Holder holder;
  private final long holdUsMax;
  private final AtomicLong sequence = new AtomicLong();
  private final ScheduledExecutorService renewer;
  private volatile String trouble = "";

  DeviceLease(Device device, Lease lease, long holdUsMax) {
    this.device = device;
    this.holdUsMax = holdUsMax;
    holder = new Holder(lease.id());
    renewer =
        Executors.newSingleThreadScheduledExecutor(
            task -> {
              Thread thread = new Thread(task, "rtpm-lease");
              thread.setDaemon(true);
              return thread;
            });
    long interval = Math.max(lease.durationUs() / 3, 1_000);
    renewer.scheduleAtFixedRate(this::renew, interval, interval, TimeUnit.MICROSECONDS);
  }

  private void renew() {
    try {
      device.expectDone("renew", Node.await(device.client().renew(holder)));
      trouble = "";
    } catch (RtpmException | DeviceException e) {
      trouble = e.getMessage();
    }
  }

  /** Why the last renewal failed; empty if it did not. */
  public String trouble() {
    return trouble;
  }

  /** The holder, for methods of {@link Device#client}. */
  public Holder holder() {
    return holder;
  }

  /**
   * Applies a force. The device's safety filter shapes it, and {@link Sample#faults} shows how (see
   * {@link Fault}); nothing is thrown:
   *
   * <ul>
   *   <li>It rises by soft start: from zero to the commanded force within {@code
   *       safety.soft_start_s}, usually 0.2 s, after {@link Device#acquire} and after each time
   *       without a live command ({@link Fault#SOFT_START}); its rate of change is limited as well
   *       ({@link Fault#FORCE_RATE_LIMITED}). So repeat the command, each time before the hold of
   *       the last one ends.
   *   <li>A force above {@code forceNewtonMax} of {@link Device#describe} is clipped, not refused
   *       ({@link Fault#FORCE_CLAMPED}).
   *   <li>After a command with a NaN or an infinity, which itself is refused, later ones are
   *       accepted, but the force stays zero until {@link #recover} ({@link
   *       Fault#COMMAND_NOT_FINITE}).
   * </ul>
   *
   * @param force newton, in the device's frame
   * @param hold for how long without a newer command; clipped to {@code holdUsMax} of {@link
   *     Device#describe}
   * @throws DeviceException if the device refuses the command; nothing of it is applied
   * @throws CallException if the device did not answer within the schema's 10 ms: send a newer one
   */
  public void force(Vector3 force, Duration hold) {
    command(CommandMode.FORCE, force, ZERO, UPRIGHT, hold);
  }

  /**
   * Moves to a pose.
   *
   * @param position metres, in the device's frame
   * @param hold as that of {@link #force}
   */
  public void pose(Vector3 position, Quaternion orientation, Duration hold) {
    command(CommandMode.POSE, ZERO, position, orientation, hold);
  }

  private void command(
      CommandMode mode,
      Vector3 force,
      Vector3 position,
      Quaternion orientation,
      Duration hold) {
    command(
        new Command(
            force,
            ZERO,
            position,
            orientation,
            ZERO,
            ZERO,
            new double[JOINT_COUNT],
            new float[JOINT_COUNT],
            0,
            0,
            Math.min(hold.toNanos() / 1000, holdUsMax),
            mode));
  }

  /**
   * Commands the device; lease and sequence are filled in.
   *
   * @throws DeviceException if the device refuses the command; nothing of it is applied
   * @throws CallException if the device did not answer within the schema's 10 ms: send a newer one
   */
  public void command(Command command) {
    Command numbered =
        new Command(
            command.forceNewton(),
            command.torqueNewtonMetre(),
            command.positionM(),
            command.orientation(),
            command.linearMPerS(),
            command.angularRadPerS(),
            command.joints(),
            command.outputs(),
            holder.lease(),
            sequence.incrementAndGet() & 0xffff_ffffL,
            command.holdUs(),
            command.mode());
    device.expectDone("command", Node.await(device.client().command(numbered)));
  }

  /**
   * Makes the device active. Returns when a sample shows it.
   *
   * @throws CallException if none does within 5 s; the message has what it shows instead
   */
  public void activate() {
    request(
        "activate",
        device.client().activate(holder),
        DRIVER_PATIENCE,
        sample -> Lifecycle.of(sample.lifecycle()) == Lifecycle.ACTIVE);
  }

  /**
   * Makes the device inactive, without force. Returns when a sample shows it.
   *
   * @throws CallException if none does within 5 s; the message has what it shows instead
   */
  public void deactivate() {
    request(
        "deactivate",
        device.client().deactivate(holder),
        DRIVER_PATIENCE,
        sample -> Lifecycle.of(sample.lifecycle()) == Lifecycle.INACTIVE);
  }

  /**
   * Clears the latched faults {@link Fault#COMMAND_NOT_FINITE} and {@link Fault#TOO_FAST}. Returns
   * when a sample no longer shows them. The force returns by soft start.
   *
   * @throws CallException if none does within 500 ms; the message has what it shows instead
   */
  public void recover() {
    request(
        "recover",
        device.client().recover(holder),
        LATCH_PATIENCE,
        sample -> !has(sample, Fault.COMMAND_NOT_FINITE) && !has(sample, Fault.TOO_FAST));
  }

  /**
   * Ends an emergency stop. Returns when a sample no longer shows it. The force returns by soft
   * start.
   *
   * @throws CallException if none does within 500 ms; the message has what it shows instead
   */
  public void rearm() {
    request(
        "rearm",
        device.client().rearm(holder),
        LATCH_PATIENCE,
        sample -> !has(sample, Fault.EMERGENCY_STOP));
  }

  private static boolean has(Sample sample, Fault fault) {
    return (sample.faults() & fault.bit()) != 0;
  }

  // The device takes a request up in its next cycle, if the lease still stands then.
  private void request(
      String method,
      CompletableFuture<Outcome> call,
      Duration patience,
      Predicate<Sample> isShown) {
    device.expectDone(method, Node.await(call));
    long end = Node.after(patience);
    // The cycle of the next sample may have begun before the request, that of the one behind not.
    long shows = device.read().sequence() + 2;
    for (Sample sample = device.read();
        sample.sequence() < shows || !isShown.test(sample);
        sample = device.read()) {
      if (ClientLoop.now() >= end || isInterrupted()) {
        throw new CallException(
            device.name() + ": " + method + ": the device took the request, but within "
                + patience.toMillis() + " ms no sample showed its effect. The last one shows "
                + Lifecycle.of(sample.lifecycle()) + " and the faults "
                + Fault.of(sample.faults()) + ": remove their cause, and ask again",
            null,
            "",
            WasRun.YES);
      }
    }
  }

  private static boolean isInterrupted() {
    try {
      Thread.sleep(READ_INTERVAL_MS);
      return false;
    } catch (InterruptedException e) {
      Thread.currentThread().interrupt();
      return true;
    }
  }

  /** Releases the device: its force falls to zero. */
  @Override
  public void close() {
    renewer.shutdownNow();
    try {
      device.expectDone("release", Node.await(device.client().release(holder)));
    } catch (RtpmException | DeviceException | IllegalStateException e) {
      // Then it ends by itself, or has ended.
      trouble = e.getMessage();
    }
  }
}

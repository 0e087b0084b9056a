package org.rtpm;

import java.time.Duration;
import java.util.concurrent.Executors;
import java.util.concurrent.ScheduledExecutorService;
import java.util.concurrent.TimeUnit;
import java.util.concurrent.atomic.AtomicLong;
import rtpm.device.Command;
import rtpm.device.CommandMode;
import rtpm.device.Holder;
import rtpm.device.Lease;
import rtpm.device.Quaternion;
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
   * Applies a force.
   *
   * @param force newton, in the device's frame
   * @param hold for how long without a newer command; at most the device's limit
   */
  public void force(Vector3 force, Duration hold) {
    command(CommandMode.FORCE, force, ZERO, UPRIGHT, hold);
  }

  /**
   * Moves to a pose.
   *
   * @param position metres, in the device's frame
   * @param hold for how long without a newer command; at most the device's limit
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

  /** Makes the device active. */
  public void activate() {
    device.expectDone("activate", Node.await(device.client().activate(holder)));
  }

  /** Makes the device inactive, without force. */
  public void deactivate() {
    device.expectDone("deactivate", Node.await(device.client().deactivate(holder)));
  }

  /** Clears a latched fault. */
  public void recover() {
    device.expectDone("recover", Node.await(device.client().recover(holder)));
  }

  /** Ends an emergency stop. */
  public void rearm() {
    device.expectDone("rearm", Node.await(device.client().rearm(holder)));
  }

  /** Releases the device: its force falls to zero. */
  @Override
  public void close() {
    renewer.shutdownNow();
    try {
      device.expectDone("release", Node.await(device.client().release(holder)));
    } catch (RtpmException | DeviceException e) {
      // Then it ends by itself, or has ended.
      trouble = e.getMessage();
    }
  }
}

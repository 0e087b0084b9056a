package org.rtpm;

import java.util.EnumSet;

/** The bits of {@link rtpm.device.Sample#faults}: why a device applies less, or no force. */
public enum Fault {
  /** No new data in this cycle, or no cycle for more than twenty periods. */
  DEVICE_LATE(0),
  /** Unreadable data in this cycle. */
  DEVICE_CORRUPT(1),
  /** The device does not answer. */
  DEVICE_GONE(2),
  /** Less force than commanded. */
  DEVICE_SATURATED(3),
  /** At or beyond the workspace's edge. */
  OUTSIDE_WORKSPACE(4),
  /** Latched: a command had a NaN or infinity. No force until {@link DeviceLease#recover}. */
  COMMAND_NOT_FINITE(8),
  /** No live command: the force went to zero. */
  COMMAND_LOST(9),
  /** This cycle's command was above the force or torque limit. */
  FORCE_CLAMPED(10),
  /** This cycle's command changed faster than the limit allows. */
  FORCE_RATE_LIMITED(11),
  /** The force is rising to the command. */
  SOFT_START(12),
  /** Latched: no force and no commands until {@link DeviceLease#rearm}. */
  EMERGENCY_STOP(13),
  /** Latched: moved faster than the limit. No force until {@link DeviceLease#recover}. */
  TOO_FAST(14),
  /** Outside the workspace; the soft wall pushes back. */
  SOFT_WALL(15),
  /** The command would have given the user more power than the limit. */
  POWER_LIMITED(16),
  /** The passivity guard is braking. */
  BRAKED(17),
  /** The force is reduced because the motors are hot. */
  HEAT_LIMITED(18),
  /** An impossible pose or time; the values are the driver's, unchanged. */
  IMPLAUSIBLE(19);

  private final long bit;

  Fault(int place) {
    bit = 1L << place;
  }

  /** The bit in {@link rtpm.device.Sample#faults}. */
  public long bit() {
    return bit;
  }

  /** The faults of a sample. Bits that this version does not know are left out. */
  public static EnumSet<Fault> of(long faults) {
    EnumSet<Fault> set = EnumSet.noneOf(Fault.class);
    for (Fault fault : values()) {
      if ((faults & fault.bit) != 0) {
        set.add(fault);
      }
    }
    return set;
  }
}

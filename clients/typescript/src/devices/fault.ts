/** Bits of `Sample.faults`: `(sample.faults & Fault.TooFast) !== 0`. */
export const Fault = {
  /** No new data in this cycle. */
  DeviceLate: 1 << 0,
  /** Unreadable data in this cycle. */
  DeviceCorrupt: 1 << 1,
  /** The device does not answer. */
  DeviceGone: 1 << 2,
  /** Less force than commanded. */
  DeviceSaturated: 1 << 3,
  /** At or beyond the workspace's edge. */
  OutsideWorkspace: 1 << 4,
  /** Latched: a command had a NaN or infinity. No force until recover(). */
  CommandNotFinite: 1 << 8,
  /** No live command: the force went to zero. */
  CommandLost: 1 << 9,
  /** This cycle's command was above the force or torque limit. */
  ForceClamped: 1 << 10,
  /** This cycle's command changed faster than the limit allows. */
  ForceRateLimited: 1 << 11,
  /** The force is rising to the command. */
  SoftStart: 1 << 12,
  /** Latched: no force, and no commands, until rearm(). */
  EmergencyStop: 1 << 13,
  /** Latched: moved faster than the limit. No force until recover(). */
  TooFast: 1 << 14,
  /** Outside the workspace; the soft wall pushes back. */
  SoftWall: 1 << 15,
  /** The command would have given the user more power than the limit. */
  PowerLimited: 1 << 16,
  /** The passivity guard is braking. */
  Braked: 1 << 17,
  /** The force is reduced because the motors are hot. */
  HeatLimited: 1 << 18,
  /** An impossible pose or time; the values are the driver's, unchanged. */
  Implausible: 1 << 19,
} as const;

const bitNames = new Map<number, string>(
  Object.entries(Fault).map(([name, bit]) => [Math.log2(bit), name]),
);

/** The names of the faults that are set, in the order of their bits: ["SoftStart"]. */
export function faultNames(faults: number): string[] {
  const names: string[] = [];
  for (let bit = 0; bit < 32; bit += 1) {
    if (((faults >>> bit) & 1) === 1) names.push(bitNames.get(bit) ?? `bit ${bit}`);
  }
  return names;
}

/** `Sample.lifecycle`, the state of a device. */
export const Lifecycle = {
  /** Not set up: no samples. */
  Unconfigured: 0,
  /** Set up, no force; the last sample stays. */
  Inactive: 1,
  /** Samples every cycle; force on command. */
  Active: 2,
  /** No answer: no force; the server tries again. */
  Fault: 3,
  /** Stopped for good. */
  Finalized: 4,
} as const;

const lifecycleNames = Object.keys(Lifecycle);

/** The name of a lifecycle: "Active". */
export function lifecycleName(lifecycle: number): string {
  return lifecycleNames[lifecycle] ?? `lifecycle ${lifecycle}`;
}

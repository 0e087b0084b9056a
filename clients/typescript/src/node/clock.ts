import { readFileSync, readlinkSync } from "node:fs";
import { clockDomainOf } from "../core/clock_domain.js";
import { millisecond, second } from "../core/numbers.js";
import type { Clock } from "../client/transport.js";

const delayMax = 3600 * second; // setTimeout takes 24 days at most

/** CLOCK_MONOTONIC on Linux, and Node's timers of one millisecond. */
export const nodeClock: Clock = {
  now: () => Number(process.hrtime.bigint()),
  at(time, run) {
    let timer: NodeJS.Timeout;
    const wait = (): void => {
      const left = time - nodeClock.now();
      const delayMs = Math.ceil(Math.min(Math.max(left, 0), delayMax) / millisecond);
      timer = setTimeout(() => (nodeClock.now() >= time ? run() : wait()), delayMs);
    };
    wait();
    return () => clearTimeout(timer);
  },
};

/** The clock_domain that this process states (hp-4.1-7); 0n where it reads another clock. */
export function ownClockDomain(): bigint {
  if (process.platform !== "linux") return 0n;
  try {
    const bootId = readFileSync("/proc/sys/kernel/random/boot_id", "utf8");
    let timeNamespace = "";
    try {
      timeNamespace = readlinkSync("/proc/self/ns/time");
    } catch {
      // The kernel has no time namespaces.
    }
    return clockDomainOf(bootId, timeNamespace);
  } catch {
    return 0n;
  }
}

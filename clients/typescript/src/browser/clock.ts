import type { Clock } from "../client/transport.js";
import { millisecond, second } from "../core/numbers.js";

const delayMax = 3600 * second; // setTimeout takes 24 days at most

/** The page's clock, and the browser's timers of a few milliseconds. */
export const pageClock: Clock = {
  now: () => performance.now() * millisecond,
  at(time, run) {
    let timer: ReturnType<typeof setTimeout>;
    const wait = (): void => {
      const left = Math.max(time - pageClock.now(), 0);
      const delayMs = Math.ceil(Math.min(left, delayMax) / millisecond);
      timer = setTimeout(() => (pageClock.now() >= time ? run() : wait()), delayMs);
    };
    wait();
    return () => clearTimeout(timer);
  },
};

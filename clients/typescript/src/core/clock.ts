import { microsecond, second } from "./numbers.js";

/** How far the server's clock is ahead of ours, in ns, and how wrong that may be. */
export interface PeerClock {
  readonly offsetNs: number;
  readonly uncertaintyNs: number;
}

interface Probe {
  at: number;
  offset: number;
  uncertainty: number;
  roundTrip: number;
}

const spanCount = 16;
const agingPerSecond = 200 * microsecond;

/** Estimates the server's clock from calls that were sent once (spec/hprotocol.md, 5.7). */
export class ClockEstimator {
  private readonly probes = new Map<number, Probe>(); // the best of each second

  /** With the times when the CALL left and came, and when the REPLY left and came. */
  add(t0: number, t1: number, t2: number, t3: number): void {
    const roundTrip = t3 - t0 - (t2 - t1);
    if (roundTrip < 0) return; // a faulty server's times
    const probe: Probe = {
      at: t3,
      offset: (t1 - t0 + (t2 - t3)) / 2,
      uncertainty: roundTrip / 2 + microsecond,
      roundTrip,
    };
    const span = Math.floor(t3 / second);
    const best = this.probes.get(span);
    if (best === undefined || roundTrip < best.roundTrip) this.probes.set(span, probe);
    for (const key of this.probes.keys()) {
      if (key <= span - spanCount) this.probes.delete(key);
    }
  }

  /** undefined before the first probe. */
  estimate(now: number): PeerClock | undefined {
    let best: PeerClock | undefined;
    for (const probe of this.probes.values()) {
      const aged = probe.uncertainty + ((now - probe.at) / second) * agingPerSecond;
      if (best === undefined || aged < best.uncertaintyNs) {
        best = { offsetNs: probe.offset, uncertaintyNs: aged };
      }
    }
    return best;
  }
}

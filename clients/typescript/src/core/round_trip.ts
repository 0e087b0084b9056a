import { copyIntervalFirst, copyIntervalMax, copyIntervalMin, never } from "./numbers.js";

/** A channel's round trip, measured by its calls (hp-5.3-1; RFC 6298 with other bounds). */
export class RoundTrip {
  intervalMin = copyIntervalMin;
  smoothed = 0;
  private deviation = 0;
  private backedOff = 0;
  private wasRepeated = false;

  add(sample: number): void {
    if (this.smoothed === 0) {
      this.smoothed = sample;
      this.deviation = Math.trunc(sample / 2);
      return;
    }
    this.deviation += Math.trunc((Math.abs(sample - this.smoothed) - this.deviation) / 4);
    this.smoothed += Math.trunc((sample - this.smoothed) / 8);
  }

  /**
   * Notes the last wait of a repeated call, 0 for one that was not. After two repeated calls in a
   * row it also holds for the next call: a round trip longer than the wait would else never be
   * measured, as repeated calls are not.
   */
  backOff(wait: number): void {
    this.backedOff = this.wasRepeated ? wait : 0;
    this.wasRepeated = wait > 0;
  }

  /** How long to wait for an answer. */
  interval(): number {
    if (this.smoothed === 0) return Math.max(copyIntervalFirst, this.intervalMin);
    const wait = this.smoothed + 4 * this.deviation;
    return Math.min(Math.max(wait, this.intervalMin), copyIntervalMax);
  }

  /** How long to wait after a call is sent first. */
  firstInterval(): number {
    return Math.max(this.interval(), this.backedOff);
  }
}

/** When a call is repeated: after the round trip's interval, doubled with each copy. */
export class CopyTimer {
  due = never;
  current = 0;
  repeatCount = 0;
  private sent = 0;
  private isMeasured = true;

  constructor(private readonly path: RoundTrip) {}

  begin(now: number): void {
    this.sent = now;
    this.repeatCount = 0;
    this.isMeasured = true;
    this.current = this.path.firstInterval();
    this.due = now + this.current;
  }

  repeat(now: number): void {
    this.repeatCount += 1;
    this.current = Math.min(2 * this.current, copyIntervalMax); // hp-5.3-3
    this.due = now + this.current;
  }

  /** A part of the answer came: the wait begins anew. */
  progress(now: number): void {
    this.wait(now, this.path.interval());
  }

  wait(now: number, interval: number): void {
    this.isMeasured = false;
    this.current = interval;
    this.due = now + interval;
  }

  /** The answer came; a repeated call is not measured (Karn). */
  end(now: number): void {
    this.due = never;
    const took = Math.max(now - this.sent, 1);
    this.path.backOff(this.repeatCount > 0 ? Math.min(this.current, Math.trunc(took * 1.25)) : 0);
    if (this.repeatCount === 0 && this.isMeasured) this.path.add(took);
  }
}

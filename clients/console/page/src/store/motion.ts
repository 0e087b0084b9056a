import {directionOf, length, readSample, readTouch, type Sample, type Touch} from '../model/sample';
import type {Message} from '../protocol/client';
import {Series} from './series';

/** Rows of five minutes at 60 Hz. */
export const kRowMax = 18000;
/** The most devices that are followed. */
export const kTrackMax = 16;
export const kSlots = 8;

/** The columns of a track's series. */
export const kColumn = {
  position: 0,
  force: 3,
  forceLength: 6,
  joint: 7,
  analog: 7 + kSlots,
  /** Degrees to the right and upwards. */
  direction: 7 + 2 * kSlots,
} as const;
const kColumnCount = kColumn.direction + 2;

/** One device's newest sample and touch, and its last minutes. */
export class Track {
  readonly series = new Series(kRowMax, kColumnCount);
  sample: Sample | null = null;
  touch: Touch | null = null;
  /** When they came, by the page's own clock. */
  sampleMs = -Infinity;
  /** The samples' clock minus the console's. */
  offsetS = 0;
  touchMs = -Infinity;
  private readonly row = new Float64Array(kColumnCount);

  takeSample(message: Message, nowMs: number): void {
    const sample = readSample(message.value);
    if (sample === null) return;
    this.sample = sample;
    this.sampleMs = nowMs;
    this.row.set(sample.positionM, kColumn.position);
    this.row.set(sample.forceNewton, kColumn.force);
    this.row[kColumn.forceLength] = length(sample.forceNewton);
    const {rightDeg, upDeg} = directionOf(sample.orientation);
    this.row.set([rightDeg, upDeg], kColumn.direction);
    for (let i = 0; i < kSlots; ++i) {
      this.row[kColumn.joint + i] = sample.joints[i] ?? NaN;
      this.row[kColumn.analog + i] = sample.analogs[i] ?? NaN;
    }
    // The way here takes now longer, now shorter: the measurement's own time draws true curves.
    const consoleS = Number(message.timeNs) / 1e9;
    const timeS = sample.hostTimeS > 0 ? sample.hostTimeS : consoleS;
    this.offsetS = timeS - consoleS;
    this.series.push(timeS, this.row);
  }

  takeTouch(message: Message, nowMs: number): void {
    const touch = readTouch(message.value);
    if (touch === null) return;
    this.touch = touch;
    this.touchMs = nowMs;
  }

  /** The present on the samples' clock: it goes on while none come. */
  endS(nowMs: number): number | null {
    const last = this.series.lastS;
    return last === null ? null : last + Math.max(0, nowMs - this.sampleMs) / 1000;
  }
}

/** The tracks of all devices of one source: the live system, or a recording. */
export class Motion {
  private readonly tracks = new Map<string, Track>();

  track(device: string): Track | null {
    return this.tracks.get(device) ?? null;
  }

  /** null where too many are followed already. */
  trackFor(device: string): Track | null {
    const known = this.tracks.get(device);
    if (known !== undefined) return known;
    if (this.tracks.size >= kTrackMax) return null;
    const track = new Track();
    this.tracks.set(device, track);
    return track;
  }

  names(): string[] {
    return [...this.tracks.keys()].sort();
  }

  drop(device: string): void {
    this.tracks.delete(device);
  }

  clear(): void {
    this.tracks.clear();
  }
}

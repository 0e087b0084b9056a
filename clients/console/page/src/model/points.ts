import {rowAtOrAfter} from './rows';

/** Curves as they are drawn: few enough points, with gaps. */

export interface Bounds {
  readonly low: number;
  readonly high: number;
}

/** The lowest and highest values from `times` to `ends`, in their order; NaN: a gap begins. */
export interface Points {
  readonly times: readonly number[];
  readonly ends: readonly number[];
  readonly low: readonly number[];
  readonly high: readonly number[];
}

/** The newest values of a curve, oldest first. */
export interface Rows {
  readonly size: number;
  readonly timeAt: (row: number) => number;
  readonly valueAt: (row: number) => number;
  /** The first row at or after `timeS`. */
  readonly rowAt: (timeS: number) => number;
}

/** The recorded past of a curve: the lowest and highest value of each step. */
export interface Past {
  readonly stepS: number;
  /** Where the steps with values begin. */
  readonly times: Float64Array;
  readonly low: Float32Array;
  readonly high: Float32Array;
}

export const kNoPast: Past = {
  stepS: 0.1,
  times: new Float64Array(),
  low: new Float32Array(),
  high: new Float32Array(),
};

export interface Curve {
  readonly ring: Rows;
  readonly past: Past;
}

const kGapMinS = 0.5;
const kGapFactor = 4;
/** Each value is a point of its own. */
const kEachS = 1e-9;

function distancesOf(size: number, timeAt: (row: number) => number): number[] {
  const first = Math.max(1, size - 32);
  return Array.from({length: Math.max(0, size - first)}, (_, i) => {
    const row = first + i;
    return timeAt(row) - timeAt(row - 1);
  });
}

function gapFor(distances: number[]): number {
  distances.sort((a, b) => a - b);
  return Math.max(kGapMinS, kGapFactor * (distances[distances.length >> 1] ?? 0));
}

/** Longer than this without a value is a gap: several times the usual distance of values. */
export function gapOf({ring, past}: Curve): number {
  return gapFor([
    ...distancesOf(ring.size, ring.timeAt),
    ...distancesOf(past.times.length, (row) => past.times[row] ?? NaN),
  ]);
}

/** One point of each column of time that has values. */
class Builder implements Points {
  readonly times: number[] = [];
  readonly ends: number[] = [];
  readonly low: number[] = [];
  readonly high: number[] = [];
  private column = NaN;
  private untilS = NaN;

  constructor(
    private readonly columnS: number,
    private readonly gapS: number,
  ) {}

  /** In order of time; the values count from `timeS` for `stepS`. */
  add(timeS: number, stepS: number, low: number, high: number): void {
    if (Number.isNaN(low)) return;
    const column = Math.floor(timeS / this.columnS);
    const last = this.times.length - 1;
    if (column === this.column) {
      this.low[last] = Math.min(this.low[last] ?? low, low);
      this.high[last] = Math.max(this.high[last] ?? high, high);
    } else {
      // Narrower than a column, it would not show.
      const isGap = timeS - this.untilS > this.gapS && column > this.column + 1;
      if (isGap) this.append(this.untilS + this.gapS / 2, NaN, NaN);
      this.append(timeS, low, high);
    }
    this.ends[this.ends.length - 1] = timeS + stepS;
    this.column = column;
    this.untilS = timeS + stepS;
  }

  private append(timeS: number, low: number, high: number): void {
    this.times.push(timeS);
    this.ends.push(timeS);
    this.low.push(low);
    this.high.push(high);
  }
}

/**
 * A curve from `beginS` to `endS` in about `count` columns, and one more at each side. Columns lie
 * at multiples of their width, so that a curve that moves does not flicker.
 */
export function binned(
  curve: Curve,
  beginS: number,
  endS: number,
  count: number,
  gapS = gapOf(curve),
): Points {
  const {ring, past} = curve;
  const columnS = (endS - beginS) / Math.max(1, count);
  const points = new Builder(columnS, gapS);
  const firstS = (Math.floor(beginS / columnS) - 1) * columnS;
  let row = ring.rowAt(firstS);
  const lastRow = ring.rowAt(endS + columnS);
  const addRows = (untilS: number) => {
    for (; row < lastRow && ring.timeAt(row) < untilS; ++row)
      points.add(ring.timeAt(row), 0, ring.valueAt(row), ring.valueAt(row));
  };
  past.times.forEach((timeS, i) => {
    if (timeS < firstS - past.stepS || timeS > endS + columnS) return;
    addRows(timeS);
    // The ring has the same values, and each of them.
    if (row < ring.size && ring.timeAt(row) < timeS + past.stepS) return;
    points.add(timeS, past.stepS, past.low[i] ?? NaN, past.high[i] ?? NaN);
  });
  addRows(Infinity);
  return points;
}

/** Values that are few enough already, which count for `stepS`; null: there is none. */
export function pointsOf(
  times: readonly number[],
  low: readonly (number | null)[],
  high: readonly (number | null)[],
  stepS: number,
): Points {
  const known = times.filter((_, i) => (low[i] ?? null) !== null);
  const points = new Builder(kEachS, gapFor(distancesOf(known.length, (i) => known[i] ?? NaN)));
  times.forEach((timeS, i) => points.add(timeS, stepS, low[i] ?? NaN, high[i] ?? NaN));
  return points;
}

/** The lowest and the highest of some values, null among them; null: there is none. */
export function boundsOfAll(all: readonly (Bounds | null)[]): Bounds | null {
  const known = all.filter((one) => one !== null);
  if (known.length === 0) return null;
  return {
    low: Math.min(...known.map((one) => one.low)),
    high: Math.max(...known.map((one) => one.high)),
  };
}

/** The lowest and the highest value in a part of the time; null: there is none. */
export function boundsOf({times, low, high}: Points, fromS: number, toS: number): Bounds | null {
  let [lowest, highest] = [Infinity, -Infinity];
  for (let i = rowAt(times, fromS); i < times.length && (times[i] ?? Infinity) <= toS; ++i) {
    const [least, most] = [low[i] ?? NaN, high[i] ?? NaN];
    // Nothing is less than NaN, nor more.
    if (least < lowest) lowest = least;
    if (most > highest) highest = most;
  }
  return highest >= lowest ? {low: lowest, high: highest} : null;
}

/** The values at a moment, or the newest before it; null: a gap, or nothing yet. */
export function valueAt({times, low, high}: Points, timeS: number): Bounds | null {
  const after = rowAt(times, timeS);
  const row = times[after] === timeS ? after : after - 1;
  const [least, most] = [low[row] ?? NaN, high[row] ?? NaN];
  return Number.isNaN(least) ? null : {low: least, high: most};
}

/** The first point at or after `timeS`. */
export function rowAt(times: readonly number[], timeS: number): number {
  return rowAtOrAfter(times.length, (row) => times[row] ?? Infinity, timeS);
}

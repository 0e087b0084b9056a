import {rowAtOrAfter} from './rows';

/** Curves over a common grid of time, as uPlot takes them. */

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

/** The newest values of a curve in a ring, oldest first. */
export class Ring {
  private readonly times: Float64Array;
  private readonly values: Float64Array;
  private begin = 0;
  private count = 0;

  constructor(readonly capacity: number) {
    this.times = new Float64Array(capacity);
    this.values = new Float64Array(capacity);
  }

  get size(): number {
    return this.count;
  }

  /** A clock that was set back by more than a second begins the ring anew. */
  push(timeS: number, value: number): void {
    const last = this.timeAt(this.count - 1);
    if (timeS <= last) {
      if (last - timeS < 1) return;
      this.begin = this.count = 0;
    }
    const at = (this.begin + this.count) % this.capacity;
    this.times[at] = timeS;
    this.values[at] = value;
    if (this.count < this.capacity) ++this.count;
    else this.begin = (this.begin + 1) % this.capacity;
  }

  timeAt(row: number): number {
    return row < 0 ? NaN : (this.times[(this.begin + row) % this.capacity] ?? NaN);
  }

  valueAt(row: number): number {
    return row < 0 ? NaN : (this.values[(this.begin + row) % this.capacity] ?? NaN);
  }

  /** The first row at or after `timeS`. */
  rowAt(timeS: number): number {
    return rowAtOrAfter(this.count, (row) => this.timeAt(row), timeS);
  }
}

export interface Curve {
  readonly ring: Ring;
  readonly past: Past;
}

/** Two points of each column: its lowest and highest value, in the order in which they came. */
export interface Binned {
  readonly times: number[];
  /** undefined: nothing of its own, the line goes on; null: a gap. */
  readonly values: (number | null | undefined)[][];
  readonly columnS: number;
}

const kGapMinS = 0.5;
const kGapFactor = 4;

/** Longer than this without a value is a gap: several times the usual distance of values. */
export function gapOf({ring, past}: Curve): number {
  const distances: number[] = [];
  for (let row = Math.max(1, ring.size - 33); row < ring.size; ++row)
    distances.push(ring.timeAt(row) - ring.timeAt(row - 1));
  for (let i = Math.max(1, past.times.length - 32); i < past.times.length; ++i)
    distances.push((past.times[i] ?? 0) - (past.times[i - 1] ?? 0));
  distances.sort((a, b) => a - b);
  return Math.max(kGapMinS, kGapFactor * (distances[distances.length >> 1] ?? 0));
}

class Column {
  private readonly values: (number | null | undefined)[];
  private readonly lastLow: Uint8Array;
  private before = NaN;
  private beforeAt = -1;

  constructor(
    count: number,
    private readonly beginS: number,
    private readonly columnS: number,
    private readonly gapS: number,
  ) {
    this.values = new Array<undefined>(2 * count).fill(undefined);
    this.lastLow = new Uint8Array(count);
  }

  /** In order of time; the values count from `timeS` for `stepS`. */
  add(timeS: number, stepS: number, low: number, high: number): void {
    if (Number.isNaN(low)) return;
    const at = Math.floor((timeS - this.beginS) / this.columnS);
    if (at < 0 || 2 * at >= this.values.length) return;
    if (timeS - this.before > this.gapS && at > this.beforeAt + 1 && this.beforeAt >= 0)
      this.values[2 * this.beforeAt + 2] = null;
    this.before = timeS + stepS;
    this.beforeAt = at;
    const first = this.values[2 * at];
    if (first === undefined || first === null) {
      this.values[2 * at] = low;
      this.values[2 * at + 1] = low === high ? undefined : high;
      return;
    }
    const second = this.values[2 * at + 1] ?? first;
    const lowest = Math.min(first, second, low);
    const highest = Math.max(first, second, high);
    if (lowest < Math.min(first, second)) this.lastLow[at] = 1;
    else if (highest > Math.max(first, second)) this.lastLow[at] = 0;
    const isFalling = this.lastLow[at] === 1;
    this.values[2 * at] = isFalling ? highest : lowest;
    this.values[2 * at + 1] = lowest === highest ? undefined : isFalling ? lowest : highest;
  }

  result(): (number | null | undefined)[] {
    return this.values;
  }
}

/** The curves from `beginS` to `endS` in about `count` columns, which lie at multiples of their width. */
export function bin(curves: readonly Curve[], beginS: number, endS: number, count: number): Binned {
  const columnS = (endS - beginS) / Math.max(1, count);
  const firstS = (Math.floor(beginS / columnS) - 1) * columnS;
  const columnCount = count + 3;
  const times: number[] = [];
  for (let i = 0; i < columnCount; ++i) {
    times.push(firstS + i * columnS, firstS + (i + 0.5) * columnS);
  }
  const values = curves.map((curve) => {
    const {ring, past} = curve;
    const column = new Column(columnCount, firstS, columnS, gapOf(curve));
    let row = ring.rowAt(firstS);
    const lastRow = ring.rowAt(firstS + columnCount * columnS);
    const addRows = (untilS: number) => {
      for (; row < lastRow && ring.timeAt(row) < untilS; ++row)
        column.add(ring.timeAt(row), 0, ring.valueAt(row), ring.valueAt(row));
    };
    past.times.forEach((timeS, i) => {
      if (timeS < firstS - past.stepS || timeS > endS + columnS) return;
      addRows(timeS);
      // The ring has the same values, and each of them.
      if (row < ring.size && ring.timeAt(row) < timeS + past.stepS) return;
      column.add(timeS, past.stepS, past.low[i] ?? NaN, past.high[i] ?? NaN);
    });
    addRows(Infinity);
    return column.result();
  });
  return {times, values, columnS};
}

/** The values of a curve at a time, or shortly before it. */
export function valuesAt(
  {times, values, columnS}: Binned,
  curve: number,
  timeS: number,
): readonly [number, number] | null {
  const column = values[curve];
  const firstS = times[0];
  if (column === undefined || firstS === undefined) return null;
  for (let at = Math.floor((timeS - firstS) / columnS); at >= 0; --at) {
    const first = column[2 * at];
    if (first === null) return null;
    if (first === undefined) continue;
    const second = column[2 * at + 1] ?? first;
    return [Math.min(first, second), Math.max(first, second)];
  }
  return null;
}

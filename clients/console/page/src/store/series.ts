import {rowAtOrAfter} from '../model/rows';

/** Columns over x, as uPlot takes them. */
export type Columns = [number[], ...(number | null)[][]];

const kLateS = 0.2;

/** Numbers over time in a ring: the newest `capacity` rows, oldest first. */
export class Series {
  private readonly times: Float64Array;
  private readonly columns: Float32Array[];
  private begin = 0;
  private count = 0;

  constructor(
    readonly capacity: number,
    columnCount: number,
  ) {
    this.times = new Float64Array(capacity);
    this.columns = Array.from({length: columnCount}, () => new Float32Array(capacity));
  }

  get size(): number {
    return this.count;
  }

  get lastS(): number | null {
    return this.count === 0 ? null : this.timeAt(this.count - 1);
  }

  /**
   * A row that is a little older than the newest one came late, and is left out. One that is much
   * older begins anew: the clock or the replay went back.
   */
  push(timeS: number, values: ArrayLike<number>): void {
    const last = this.lastS;
    if (last !== null && timeS <= last) {
      if (last - timeS < kLateS) return;
      this.clear();
    }
    const at = (this.begin + this.count) % this.capacity;
    this.times[at] = timeS;
    this.columns.forEach((column, i) => (column[at] = values[i] ?? NaN));
    if (this.count < this.capacity) ++this.count;
    else this.begin = (this.begin + 1) % this.capacity;
  }

  clear(): void {
    this.begin = this.count = 0;
  }

  timeAt(row: number): number {
    return this.times[(this.begin + row) % this.capacity] ?? NaN;
  }

  valueAt(row: number, column: number): number {
    return this.columns[column]?.[(this.begin + row) % this.capacity] ?? NaN;
  }

  /** The first row at or after `timeS`; `size` if there is none. */
  rowAt(timeS: number): number {
    return rowAtOrAfter(this.count, (row) => this.timeAt(row), timeS);
  }

  /**
   * The rows of the `windowS` seconds before `endS`, as seconds relative to `endS`. More than
   * `pointMax` rows become the lowest and the highest value of equal spans, which lie at multiples
   * of their length, so that a curve does not flicker. Where nothing came for `gapS` is a gap.
   */
  window(
    endS: number,
    windowS: number,
    picked: readonly number[],
    pointMax: number,
    gapS: number,
  ): Columns {
    const first = this.rowAt(endS - windowS);
    const last = this.rowAt(endS + 1e-9);
    const result: Columns = [[], ...picked.map(() => [] as (number | null)[])];
    const spanS = last - first <= pointMax ? 0 : (2 * windowS) / pointMax;
    let before = NaN;
    for (let row = first; row < last;) {
      const timeS = this.timeAt(row);
      if (timeS - before > gapS) this.addGap(result, before - endS + 1e-3);
      row =
        spanS === 0
          ? this.addRow(result, picked, row, endS)
          : this.addSpan(result, picked, row, last, spanS, endS);
      before = this.timeAt(row - 1);
    }
    return result;
  }

  private addGap(result: Columns, x: number): void {
    result[0].push(x);
    for (const column of result.slice(1) as (number | null)[][]) column.push(null);
  }

  private addRow(result: Columns, picked: readonly number[], row: number, endS: number): number {
    result[0].push(this.timeAt(row) - endS);
    picked.forEach((column, i) => {
      const value = this.valueAt(row, column);
      (result[i + 1] as (number | null)[]).push(Number.isNaN(value) ? null : value);
    });
    return row + 1;
  }

  private addSpan(
    result: Columns,
    picked: readonly number[],
    first: number,
    last: number,
    spanS: number,
    endS: number,
  ): number {
    const spanEndS = (Math.floor(this.timeAt(first) / spanS) + 1) * spanS;
    let row = first;
    while (row < last && this.timeAt(row) < spanEndS) ++row;
    if (row === first) ++row;
    result[0].push(spanEndS - spanS - endS, spanEndS - spanS / 2 - endS);
    picked.forEach((column, i) => {
      let low = Infinity;
      let high = -Infinity;
      for (let at = first; at < row; ++at) {
        const value = this.valueAt(at, column);
        if (value < low) low = value;
        if (value > high) high = value;
      }
      const isThere = low <= high;
      (result[i + 1] as (number | null)[]).push(isThere ? low : null, isThere ? high : null);
    });
    return row;
  }
}

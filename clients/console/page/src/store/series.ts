import type {Rows} from '../model/points';
import {rowAtOrAfter} from '../model/rows';

const kLateS = 0.2;

/** Numbers over time in a ring: the newest `capacity` rows, oldest first. */
export class Series {
  private readonly times: Float64Array;
  private readonly columns: (Float32Array | Float64Array)[];
  private begin = 0;
  private count = 0;

  constructor(
    readonly capacity: number,
    columnCount: number,
    Column: Float32ArrayConstructor | Float64ArrayConstructor = Float32Array,
  ) {
    this.times = new Float64Array(capacity);
    this.columns = Array.from({length: columnCount}, () => new Column(capacity));
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

  /** One column, as curves are made of; it follows the series. */
  column(at: number): Rows {
    const size = () => this.count;
    return {
      get size() {
        return size();
      },
      timeAt: (row) => this.timeAt(row),
      valueAt: (row) => this.valueAt(row, at),
      rowAt: (timeS) => this.rowAt(timeS),
    };
  }
}

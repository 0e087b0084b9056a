import {describe, expect, it} from 'vitest';
import {Series} from '../src/store/series';

function filled(count: number, capacity = 100): Series {
  const series = new Series(capacity, 2);
  for (let i = 0; i < count; ++i) series.push(i / 10, [i, -i]);
  return series;
}

describe('Series', () => {
  it('keeps the newest rows only', () => {
    const series = filled(250);
    expect(series.size).toBe(100);
    expect(series.timeAt(0)).toBe(15);
    expect(series.valueAt(99, 1)).toBe(-249);
  });

  it('leaves out what comes late', () => {
    const series = filled(50);
    series.push(4.85, [9, 9]);
    series.push(4.9, [9, 9]);
    expect(series.size).toBe(50);
    expect(series.valueAt(49, 0)).toBe(49);
  });

  it('begins anew when the time goes back', () => {
    const series = filled(50);
    series.push(1, [5, 5]);
    expect(series.size).toBe(1);
    expect(series.lastS).toBe(1);
  });
});

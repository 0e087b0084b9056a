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

  it('shows the window in seconds before its end', () => {
    const [x, y] = filled(50).window(4.9, 1.05, [0], 900, 0.5);
    expect(x[0]).toBeCloseTo(-1, 9);
    expect(x.at(-1)).toBeCloseTo(0, 9);
    expect(y).toEqual([39, 40, 41, 42, 43, 44, 45, 46, 47, 48, 49]);
  });

  it('leaves a gap where nothing came', () => {
    const series = filled(3);
    series.push(5, [7, 7]);
    const [, y] = series.window(5, 10, [0], 900, 0.5);
    expect(y).toEqual([0, 1, 2, null, 7]);
  });

  it('shows extremes when there are too many rows, and no more points than asked for', () => {
    const series = new Series(20000, 1);
    for (let i = 0; i < 18000; ++i) series.push(i / 60, [i === 9000 ? 99 : Math.sin(i)]);
    const [x, y] = series.window(300, 300, [0], 900, 0.5);
    expect(x.length).toBeLessThanOrEqual(904);
    expect(Math.max(...(y as number[]))).toBe(99);
    expect(x.every((one, i) => i === 0 || one > (x[i - 1] ?? 0))).toBe(true);
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

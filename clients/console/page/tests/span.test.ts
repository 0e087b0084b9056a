import {describe, expect, it} from 'vitest';
import {boundsText, decadeAxis, linearAxis, shareOfValue, withMargin} from '../src/model/axis';
import {
  centred,
  digitsFor,
  kLengthMinS,
  lengthOf,
  momentText,
  moved,
  shareOf,
  stepFor,
  ticksOf,
  timeAt,
  within,
  zoomed,
} from '../src/model/span';

const whole = {fromS: 0, toS: 3600};

describe('zoom', () => {
  it('keeps the moment under the pointer', () => {
    const span = zoomed({fromS: 100, toS: 200}, 0.5, 125, whole);
    expect(span).toEqual({fromS: 112.5, toS: 162.5});
    expect(shareOf(span, 125)).toBe(0.25);
  });

  it('goes down to a millisecond and back to the whole, and no further', () => {
    let span = {...whole};
    for (let i = 0; i < 200; ++i) span = zoomed(span, 0.8, 1234.5678, whole);
    expect(lengthOf(span)).toBeCloseTo(kLengthMinS, 9);
    expect(span.fromS).toBeLessThanOrEqual(1234.5678);
    expect(span.toS).toBeGreaterThanOrEqual(1234.5678);
    for (let i = 0; i < 200; ++i) span = zoomed(span, 1.25, 1234.5678, whole);
    expect(span).toEqual(whole);
  });

  it('stays inside at the edges', () => {
    expect(moved({fromS: 0, toS: 10}, -0.5, whole)).toEqual({fromS: 0, toS: 10});
    expect(moved({fromS: 3595, toS: 3600}, 3, whole)).toEqual({fromS: 3595, toS: 3600});
    expect(centred({fromS: 0, toS: 10}, 3599, whole)).toEqual({fromS: 3590, toS: 3600});
    expect(within({fromS: -5, toS: 4000}, whole)).toEqual(whole);
    expect(timeAt({fromS: 10, toS: 20}, 0.3)).toBe(13);
  });

  it('widens what is too short around its middle', () => {
    const span = within({fromS: 5, toS: 5}, whole);
    expect(span.fromS).toBeCloseTo(4.9995, 9);
    expect(span.toS).toBeCloseTo(5.0005, 9);
  });

  it('shows all of a recording that is shorter than the least', () => {
    expect(zoomed({fromS: 0, toS: 1e-4}, 0.5, 0, {fromS: 0, toS: 1e-4})).toEqual({
      fromS: 0,
      toS: 1e-4,
    });
  });
});

describe('labels', () => {
  it('have round steps', () => {
    expect(stepFor(3600, 8)).toBe(600);
    expect(stepFor(60, 8)).toBe(10);
    expect(stepFor(1, 8)).toBeCloseTo(0.2, 12);
    expect(stepFor(0.001, 8)).toBeCloseTo(0.0002, 12);
    expect(stepFor(20 * 86_400, 4)).toBe(5 * 86_400);
    expect(ticksOf({fromS: 0.05, toS: 0.35}, 0.1)).toHaveLength(3);
    expect(ticksOf({fromS: 0, toS: 60}, 10)).toEqual([0, 10, 20, 30, 40, 50, 60]);
  });

  it('tell neighbours apart', () => {
    expect(digitsFor(10)).toBe(0);
    expect(digitsFor(0.2)).toBe(1);
    expect(digitsFor(0.0002)).toBe(4);
    expect([momentText(61.5, 1), momentText(5, 0)]).toEqual(['1:01.5', '0:05']);
    expect(momentText(59.96, 1)).toBe('1:00.0');
    expect(momentText(3661.5, 1)).toBe('1:01:01.5');
    expect(momentText(-0.5, 1)).toBe('−0:00.5');
    expect(momentText(-0.01, 1)).toBe('0:00.0');
  });

  it('of values surround them', () => {
    const scale = {unit: 'mm', factor: 1000, digits: 1};
    const axis = linearAxis(withMargin({low: -0.001, high: 0.001}, 0), scale, 5);
    expect(axis.low).toBeLessThan(-0.001);
    expect(axis.high).toBeGreaterThan(0.001);
    // Round in the shown unit, and where the measured value is.
    expect(axis.ticks.map((one) => one.text)).toEqual(['−1.0', '−0.5', '0.0', '0.5', '1.0']);
    expect(shareOfValue(axis, axis.ticks[2]?.value ?? NaN)).toBeCloseTo(0.5, 9);
    // A constant still has an axis with a height, and so has nothing.
    for (const bounds of [{low: 5, high: 5}, null]) {
      const flat = withMargin(bounds, 0);
      expect(flat.high).toBeGreaterThan(flat.low);
    }
    expect(boundsText({low: 0.001, high: 0.0025}, scale)).toBe('1.0 … 2.5 mm');
    expect([boundsText({low: -1, high: -1}, scale), boundsText(null, scale)]).toEqual([
      '−1000.0 mm',
      '–',
    ]);
  });

  it('of latencies are at powers of ten', () => {
    const axis = decadeAxis({low: 40, high: 90}, {unit: 'µs', factor: 1, digits: 0});
    expect(axis.ticks.map((one) => one.text)).toEqual(['10 µs', '100 µs', '1 ms']);
    expect(shareOfValue(axis, axis.low)).toBe(0);
  });
});

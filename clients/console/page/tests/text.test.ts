import {afterEach, describe, expect, it} from 'vitest';
import {check, valueText} from '../src/forms/validate';
import type {Parameter} from '../src/forms/parameter';
import {momentText} from '../src/model/span';
import {bytes, dayAndTime, duration, fixed, micros, parsed, plain} from '../src/parts/text';
import {chooseMark, mark} from '../src/store/settings';
import {choose, language} from '../src/texts/texts';

afterEach(() => {
  choose('en');
  chooseMark('point');
});

describe('the decimal mark', () => {
  it('follows the language until one is chosen', () => {
    expect(mark.value).toBe('point');
    choose('de');
    expect(language.value).toBe('de');
    expect(mark.value).toBe('comma');
    chooseMark('point');
    expect(fixed(1.5, 1)).toBe('1.5');
  });

  it('is in every number', () => {
    chooseMark('comma');
    expect(fixed(-1.25, 2)).toBe('−1,25');
    expect(fixed(-0.001, 2)).toBe('0,00');
    expect(fixed(12345.6, 1)).toBe('12\u202f345,6');
    expect(plain(2.5e-5)).toBe('2,5e-5');
    expect(duration(1.5)).toBe('1,5 s');
    expect(momentText(61.5, 1)).toBe('1:01,5');
    expect(bytes(1_250_000)).toBe('1,3 MB');
    expect(micros(1500)).toBe('1,50 ms');
  });

  it('names months in the language', () => {
    const may = new Date(2026, 4, 3, 14, 2, 3).getTime();
    expect(dayAndTime(may)).toBe('03 May, 14:02:03');
    choose('de');
    expect(dayAndTime(may)).toBe('03. Mai, 14:02:03');
  });
});

describe('a typed number', () => {
  it('has a point or a comma', () => {
    for (const format of ['point', 'comma'] as const) {
      chooseMark(format);
      expect(['0.25', '0,25', '-.5', '−1,5', '2,5e-3', '12\u202f345'].map(parsed)).toEqual([
        0.25, 0.25, -0.5, -1.5, 0.0025, 12345,
      ]);
      expect(['', '1,2,3', '1.2,3', 'one', '0x10'].map(parsed)).toEqual(Array(5).fill(null));
    }
  });

  it('is refused where it may mean thousands', () => {
    expect(parsed('1,500')).toBeNull();
    expect(parsed('1.500')).toBe(1.5);
    expect(parsed('0,125')).toBe(0.125);
    chooseMark('comma');
    expect(parsed('1.500')).toBeNull();
    expect(parsed('1,500')).toBe(1.5);
  });

  const vector = (vectorSize: number) =>
    ({type: 'Vector', vectorSize, low: -10, high: 10, unit: 'm'}) as Parameter;

  it('of a vector is read as it is shown, in both formats', () => {
    for (const format of ['point', 'comma'] as const) {
      chooseMark(format);
      const value = [0.25, -1.5, 3];
      expect(check(vector(3), valueText(value))).toEqual({isValid: true, value});
      expect(check(vector(3), '0,25 -1,5 3')).toEqual({isValid: true, value});
      expect(check(vector(3), '0.25, -1.5, 3')).toEqual({isValid: true, value});
    }
  });

  it('of a vector is not taken for two', () => {
    expect(check(vector(3), '1,2,3')).toEqual({isValid: true, value: [1, 2, 3]});
    // Two of four numbers, and not one, two, three and four.
    expect(check(vector(4), '1,2 3,4').isValid).toBe(false);
    chooseMark('comma');
    expect(check(vector(2), '1,5').isValid).toBe(false);
    expect(check(vector(3), '1,2,3').isValid).toBe(false);
  });
});

import {describe, expect, it} from 'vitest';
import {directionOf} from '../src/model/sample';
import {byUnit, shownScale} from '../src/model/scale';
import {chooseAngle} from '../src/store/settings';
import {sensesPlace, sensesTurn, type Device} from '../src/model/state';

describe('scales', () => {
  it('show small quantities with a prefix, by their range', () => {
    expect(shownScale({unit: 'S', low: 0, high: 50e-6})).toEqual({
      unit: 'µS',
      factor: 1e6,
      digits: 2,
    });
    expect(shownScale({unit: 'm', low: 0, high: 0.01})).toEqual({
      unit: 'mm',
      factor: 1e3,
      digits: 2,
    });
  });

  it('leave other units and unknown ranges as they are', () => {
    expect(shownScale({unit: 'Hz', low: 0, high: 4}).unit).toBe('Hz');
    expect(shownScale({unit: '1', low: 0, high: 1}).unit).toBe('');
    expect(shownScale({unit: 'rad', low: -1, high: 1}).unit).toBe('°');
    expect(shownScale({unit: 'S', low: 0, high: 0})).toMatchObject({unit: 'S', factor: 1});
    expect(shownScale({unit: 'm', low: -Infinity, high: Infinity}).unit).toBe('m');
  });

  it('show angles as chosen, whichever way they were measured', () => {
    expect(shownScale({unit: 'rad/s', low: -1, high: 1}).factor).toBeCloseTo(57.3, 1);
    chooseAngle('radians');
    expect(shownScale({unit: 'rad', low: -1, high: 1})).toMatchObject({unit: 'rad', factor: 1});
    const degrees = shownScale({unit: '°', low: -180, high: 180});
    expect(degrees).toMatchObject({unit: 'rad', digits: 3});
    expect(degrees.factor).toBeCloseTo(0.01745, 5);
    chooseAngle('degrees');
  });

  it('share an axis only within a unit', () => {
    const groups = byUnit([
      {name: 'pulse', unit: '1', low: 0, high: 1},
      {name: 'heart_rate', unit: 'Hz', low: 0, high: 4},
      {name: 'skin_conductance', unit: 'S', low: 0, high: 50e-6},
      {name: 'breath', unit: '1', low: 0, high: 1},
    ]);
    expect(groups.map(({shown, members}) => [shown.unit, members.map((one) => one.index)])).toEqual(
      [
        ['', [0, 3]],
        ['Hz', [1]],
        ['µS', [2]],
      ],
    );
  });
});

describe('directions', () => {
  it('are where the -z axis points', () => {
    expect(directionOf([0, 0, 0, 1])).toMatchObject({
      rightDeg: expect.closeTo(0),
      upDeg: expect.closeTo(0),
    });
    const half = Math.PI / 36;
    // 10° upwards: about x. 10° to the right: about -y.
    expect(directionOf([Math.sin(half), 0, 0, Math.cos(half)]).upDeg).toBeCloseTo(10);
    expect(directionOf([0, -Math.sin(half), 0, Math.cos(half)]).rightDeg).toBeCloseTo(10);
  });

  it('are of devices that sense how they are turned', () => {
    const axes = (...names: string[]) =>
      ({
        axes: names.map((name) => ({name, isSensed: true})),
      }) as unknown as Device;
    expect([sensesPlace(axes('rx', 'ry')), sensesTurn(axes('rx', 'ry'))]).toEqual([false, true]);
    expect([sensesPlace(axes('x', 'y', 'z')), sensesTurn(axes('x', 'y', 'z'))]).toEqual([
      true,
      false,
    ]);
    expect([sensesPlace(axes()), sensesTurn(axes())]).toEqual([false, false]);
  });
});

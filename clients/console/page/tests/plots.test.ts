import {describe, expect, it} from 'vitest';
import {binned, boundsOf, gapOf, kNoPast, valueAt, type Past} from '../src/model/points';
import {Series} from '../src/store/series';
import {fieldReader, liveTopicOf, splitPath, subjectOf, unitOf} from '../src/model/fields';
import {
  decode,
  deviceLayout,
  encode,
  kCurveMax,
  kCurvesInAllMax,
  kPlotMax,
  readLayout,
  type Layout,
} from '../src/model/layout';
import {prefixFor} from '../src/model/scale';
import {readState, type Device} from '../src/model/state';
import type {Channel} from '../src/protocol/client';
import {readRoute} from '../src/store/route';

const kLayout: Layout = {
  name: 'Größe µ <b>1</b>',
  windowS: 60,
  plots: [
    {
      title: 'Force',
      kind: 'time',
      fields: ['lab/arm0/sampled.force_newton.x', 'lab/arm1/sampled.force_newton.x'],
      thresholds: [{value: 5, unit: 'N', label: 'limit', side: 'above'}],
    },
    {title: '', kind: 'direction', fields: ['lab/gaze0'], thresholds: []},
  ],
};

function device(more: object): Device {
  const [made] = readState({devices: [{name: 'lab/a', ...more}]}).devices;
  if (made === undefined) throw new Error('no device');
  return made;
}

function channels(...topics: string[]): ReadonlyMap<string, Channel> {
  const one = {encoding: '', schemaName: '', schema: ''};
  return new Map(topics.map((topic, id) => [topic, {...one, id, topic}]));
}

describe('layouts', () => {
  it('are the same after a way through a URL', () => {
    const code = encode(kLayout);
    expect(code).toMatch(/^[\w-]+$/);
    expect(decode(code)).toEqual(kLayout);
  });

  it('are none where the URL is broken', () => {
    for (const bad of ['', 'x', '%zz', '<script>', encode(kLayout).slice(5), 'A'.repeat(20000)])
      expect(decode(bad), bad.slice(0, 20)).toBeNull();
    expect(readLayout({plots: 5})).toBeNull();
    expect(readLayout(null)).toBeNull();
    expect(readRoute('#/plots/%zz').subject).toBe('%zz');
  });

  it('are bounded whatever comes', () => {
    const fields = Array.from({length: 100}, (_, i) => `lab/a/sampled.value[${i}]`);
    const plot = {title: 't'.repeat(1000), fields, thresholds: Array(100).fill({value: 1})};
    const layout = readLayout({name: 'n\u202e\n', windowS: 1e9, plots: Array(100).fill(plot)});
    expect(layout?.plots.length).toBe(kPlotMax);
    expect(layout?.plots[0]?.fields.length).toBe(kCurveMax);
    const all = layout?.plots.reduce((sum, one) => sum + one.fields.length, 0);
    expect(all).toBe(kCurvesInAllMax);
    expect(layout?.name).toBe('n');
    expect(layout?.windowS).toBe(4 * 3600);
    const odd = readLayout({plots: [{fields: ['a\u0000b', 7, 'x'.repeat(300)], kind: 'evil'}]});
    expect(odd?.plots[0]).toMatchObject({fields: [], kind: 'time'});
  });

  it('suit the class of a device', () => {
    const sensed = (...names: string[]) => names.map((name) => ({name, is_sensed: true}));
    const titles = (more: object) => deviceLayout(device(more)).plots.map((one) => one.title);
    expect(titles({axes: sensed('x', 'y', 'z'), force_newton_max: 9})).toEqual([
      'Position',
      'Force',
    ]);
    const gaze = deviceLayout(device({class: 'Tracker', axes: sensed('rx', 'ry')}));
    expect(gaze.plots.map((one) => one.kind)).toEqual(['direction', 'time']);
    const scale = (name: string, unit: string) => ({name, unit, low: 0, high: 1});
    const analogs = [scale('pulse', '1'), scale('rate', 'Hz'), scale('skin', 'S')];
    expect(titles({class: 'Biometric', analogs})).toEqual(['pulse, rate', 'skin']);
    expect(titles({class: 'Dial', joints: [scale('dial', 'rad')]})).toEqual([
      'dial',
      'Velocity, effort',
    ]);
    expect(titles({class: 'Player', outputs: [scale('rate', '1')]})).toEqual(['rate']);
    expect(titles({class: 'Poser', axes: sensed('x', 'y', 'z')})).toEqual(['Position', 'Velocity']);
    expect(titles({class: 'Input'})).toEqual(['Buttons']);
  });
});

describe('fields', () => {
  it('are named by their topic', () => {
    expect(splitPath('lab/arm.0/sampled.position_m.x')).toEqual({
      topic: 'lab/arm.0/sampled',
      field: 'position_m.x',
    });
    expect(subjectOf('lab/arm0/config.safety.ramp_s')).toBe('lab/arm0');
  });

  it('come from the channel that has them now', () => {
    const known = channels('lab/arm0/sample', 'lab/arm0/event', 'rtpm.touch.Touched/3571832195');
    const of = (topic: string) => liveTopicOf(topic, known);
    expect(of('lab/arm0/sampled')).toEqual({channel: 'lab/arm0/sample', change: ''});
    expect(of('lab/arm0/touched')?.channel).toBe('rtpm.touch.Touched/3571832195');
    expect(of('lab/arm0/contact_changed')).toEqual({
      channel: 'lab/arm0/event',
      change: 'contact_changed',
    });
    expect(of('lab/arm0/config')).toBeNull();
    expect(of('lab/gone/sampled')).toBeNull();
  });

  it('are read from decoded messages', () => {
    const knob = device({
      joints: [
        {name: 'a', unit: 'm'},
        {name: 'dial.x', unit: 'rad'},
      ],
    });
    const message = {
      sample: {
        position_m: {x: 1, y: 2, z: 3},
        force_newton: {x: 3, y: 4, z: 0},
        orientation: {x: 0, y: 0, z: 0, w: 1},
        joints: [7, 8],
        sequence: 5n,
      },
    };
    const read = (field: string, of: Device | null = knob) => fieldReader(field, of)(message);
    expect(read('position_m.y')).toBe(2);
    expect(read('joints.dial.x')).toBe(8);
    expect(read('joints[0]', null)).toBe(7);
    expect(read('sequence')).toBe(5);
    expect(read('force_newton.total')).toBe(5);
    expect(read('direction_deg.up')).toBeCloseTo(0);
    expect(read('nothing.at.all')).toBeNaN();
    expect(fieldReader('a', null)({a: true, b: 1})).toBe(1);
    expect([
      unitOf('lab/a/sampled.joints.dial.x', knob),
      unitOf('x/y.linear_m_per_s.x', null),
    ]).toEqual(['rad', 'm/s']);
  });
});

describe('axes', () => {
  it('take the prefix that leaves one to three digits', () => {
    const of = (size: number, unit: string) => prefixFor(size, unit).prefix + unit;
    expect(of(0.0042, 'N')).toBe('mN');
    expect(of(3.2e-6, 'S')).toBe('µS');
    expect(of(4200, 'N')).toBe('kN');
    expect(of(0.5, 'm/s')).toBe('mm/s');
    expect(of(5e6, 'Pa')).toBe('MPa');
    expect(of(7200, 's')).toBe('s');
    expect(of(0.001, '°')).toBe('°');
    expect(of(0, 'N')).toBe('N');
  });
});

describe('curves', () => {
  const ring = (...rows: (readonly [number, number])[]) => {
    const made = new Series(1000, 1, Float64Array);
    for (const [time, value] of rows) made.push(time, [value]);
    return made.column(0);
  };
  const past = (beginS: number, stepS: number, ...values: number[]): Past => ({
    stepS,
    times: Float64Array.from(values, (_, i) => beginS + i * stepS),
    low: Float32Array.from(values),
    high: Float32Array.from(values, (value) => value + 1),
  });
  /** The lowest and highest values of the columns, gaps as null. */
  const shown = (curve: Parameters<typeof binned>[0], beginS: number, endS: number) => {
    const {low, high} = binned(curve, beginS, endS, 10);
    return low.flatMap((value, i) =>
      Number.isNaN(value) ? [null] : value === high[i] ? [value] : [value, high[i]],
    );
  };

  it('have the recorded past before what came, each value once', () => {
    const curve = {ring: ring([12.05, 5], [12.95, 6], [13.5, 7]), past: past(10, 1, 1, 2, 3, 4)};
    // The steps of 12 and 13 s are in the ring, value by value.
    expect(shown(curve, 10, 20)).toEqual([1, 2, 2, 3, 5, 6, 7]);
  });

  it('fill a pause of the page from the past', () => {
    const rows = ring([10, 1], [10.5, 1], [11, 1], [17, 9], [17.5, 9]);
    const curve = {ring: rows, past: past(12, 1, 5, 5, 5, 5)};
    expect(shown(curve, 10, 20)).toEqual([1, 1, 5, 6, 5, 6, 5, 6, 5, 6, 9]);
  });

  it('have a gap where nothing came', () => {
    const rows = ring([10, 1], [10.5, 1], [11, 2], [17, 9], [17.5, 9]);
    expect(shown({ring: rows, past: kNoPast}, 10, 20)).toEqual([1, 2, null, 9]);
  });

  it('keep the lowest and the highest of a column', () => {
    const rows = Array.from({length: 600}, (_, i) => [i / 60, Math.sin(i)] as const);
    const points = binned({ring: ring(...rows), past: kNoPast}, 0, 10, 10);
    expect(points.times.length).toBeLessThanOrEqual(12);
    const {low, high} = valueAt(points, 5.5) ?? {};
    expect(low).toBeLessThan(-0.99);
    expect(high).toBeGreaterThan(0.99);
    expect(boundsOf(points, 5, 5.9)?.high).toBe(high);
    expect(valueAt(points, -100)).toBeNull();
  });

  it('have no value in a gap', () => {
    const rows = ring([10, 1], [10.2, 1], [10.4, 1], [17, 9]);
    const points = binned({ring: rows, past: kNoPast}, 10, 20, 100);
    expect(valueAt(points, 10.5)).toEqual({low: 1, high: 1});
    expect(valueAt(points, 16.9)).toBeNull();
    expect(valueAt(points, 17.1)).toEqual({low: 9, high: 9});
  });

  it('stay connected where values are rare', () => {
    const rare = {ring: ring([0, 1], [10, 2], [20, 3], [30, 4]), past: kNoPast};
    expect(gapOf(rare)).toBe(40);
    expect(shown(rare, 0, 40)).not.toContain(null);
  });

  it('begin anew where the clock was set back', () => {
    const rows = ring([100, 1], [101, 2], [50, 3], [49.9, 4]);
    // The last one came late.
    expect([rows.size, rows.timeAt(0), rows.valueAt(0)]).toEqual([1, 50, 3]);
  });
});

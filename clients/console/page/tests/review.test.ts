import {describe, expect, it} from 'vitest';
import {
  byUnit,
  commonLabels,
  cutName,
  firstFields,
  mostTelling,
  originOf,
  readCurves,
  readRun,
  search,
  secondsSince,
  shortName,
  timeNsAt,
  withEnding,
} from '../src/model/review';
import {boundsOf, valueAt} from '../src/model/points';
import {parseJson} from '../src/protocol/json';

const kBegin = 1_700_000_000_000_000_123n;

function runOf(labels: readonly string[]) {
  const markers = labels.map(
    (label, i) => `{"time_ns":${kBegin + BigInt(i) * 1_000_000_000n},"label":"${label}"}`,
  );
  return readRun(
    'run.mcap',
    parseJson(
      `{"begin_ns":${kBegin},"end_ns":${kBegin + 60_000_000_000n},"markers":[${markers.join()}],` +
        `"marker_count":${labels.length},"trials":[{"begin_ns":${kBegin + 5n},"end_ns":null,` +
        `"number":3,"condition":"soft","response":""}],"notes":[{"time_ns":${kBegin},"text":"a"}]}`,
    ),
  );
}

describe('times', () => {
  it('stay exact to the nanosecond', () => {
    expect(timeNsAt(kBegin, 0)).toBe(kBegin);
    expect(timeNsAt(kBegin, 3599.000_000_001)).toBe(kBegin + 3_599_000_000_001n);
    expect(secondsSince(kBegin, kBegin + 1n)).toBe(1e-9);
    expect(timeNsAt(0n, -5)).toBe(0n);
  });
});

describe('a run', () => {
  it('is read', () => {
    const run = runOf(['start']);
    expect(run.lengthS).toBe(60);
    expect(run.happenings.map((one) => one.kind)).toEqual(['marker', 'trial']);
    expect(run.happenings[1]).toMatchObject({number: 3, endS: null, text: 'soft'});
    expect(run.notes[0]).toMatchObject({kind: 'note', text: 'a', timeNs: kBegin});
  });

  it('is aligned with another by a marker that both have', () => {
    const [a, b] = [runOf(['start', 'go', 'go']), runOf(['x', 'y', 'go'])];
    expect(commonLabels(a, b)).toEqual(['go']);
    expect([originOf(a, 'go'), originOf(b, 'go'), originOf(b, '')]).toEqual([1, 2, 0]);
    expect(originOf(b, 'start')).toBeNull();
  });
});

describe('happenings', () => {
  const [marker, trial] = runOf(['start']).happenings;
  const faults = Array.from({length: 300}, () => ({...marker!, kind: 'fault' as const}));

  it('of people stay in a list that faults would fill', () => {
    const all = [...faults, marker!, trial!];
    expect(mostTelling(all, 200)).toEqual([...faults.slice(0, 198), marker, trial]);
    expect(mostTelling(all, 1)).toEqual([marker]);
  });

  it('all stay where they are few', () => {
    expect(mostTelling([marker!, ...faults], 301)).toHaveLength(301);
  });
});

describe('curves', () => {
  const read = readCurves(
    kBegin,
    parseJson(
      `{"begin_ns":${kBegin + 1_000_000_000n},"bucket_ns":500000000,"is_exact":true,"series":[` +
        '{"field":"a","low":[1,null,-3],"high":[2,null,5]},' +
        '{"field":"b","offset_ns":[-1000000,0,2000000],"values":[7,8,9]}]}',
    ),
  );
  const [steps, samples] = [read.byField.get('a'), read.byField.get('b')];
  if (steps === undefined || samples === undefined) throw new Error('a curve is missing');

  it('have the value of the moment', () => {
    expect(valueAt(steps, 1.2)).toEqual({low: 1, high: 2});
    expect(valueAt(steps, 1.7)).toEqual({low: 1, high: 2});
    expect(valueAt(steps, 2.1)).toEqual({low: -3, high: 5});
    expect(valueAt(steps, 0.9)).toBeNull();
    expect(valueAt(samples, 1.0005)).toEqual({low: 8, high: 8});
    expect(valueAt(samples, 0.9)).toBeNull();
  });

  it('have bounds in a part', () => {
    expect(boundsOf(steps, 0, 10)).toEqual({low: -3, high: 5});
    expect(boundsOf(steps, 1, 1.4)).toEqual({low: 1, high: 2});
    expect(boundsOf(samples, 1, 1.001)).toEqual({low: 8, high: 8});
    expect(boundsOf(samples, 5, 6)).toBeNull();
  });
});

describe('fields', () => {
  const fields = ['force_newton.x', 'position_m.x', 'joints.elbow'].map((name) => ({
    path: `lab/arm0/sampled.${name}`,
    unit: name.startsWith('force') ? 'N' : 'm',
  }));

  it('are found by words in any order', () => {
    expect(search(fields, 'newton arm0', 9).map((one) => one.path)).toEqual([
      'lab/arm0/sampled.force_newton.x',
    ]);
    expect(search(fields, '', 2)).toHaveLength(2);
  });

  it('share an axis by unit', () => {
    expect(byUnit(fields).map((group) => group.length)).toEqual([1, 2]);
    expect(firstFields(fields)).toEqual([
      'lab/arm0/sampled.position_m.x',
      'lab/arm0/sampled.force_newton.x',
    ]);
    expect(shortName('lab.Touched/3.force.x')).toEqual({topic: 'lab.Touched/3', name: 'force.x'});
  });
});

it('names of files are made', () => {
  expect(cutName('run.mcap', new Set())).toBe('run-cut.mcap');
  expect(cutName('run.mcap', new Set(['run-cut.mcap']))).toBe('run-cut2.mcap');
  expect(withEnding(' best run ')).toBe('best run.mcap');
  expect(withEnding('a.mcap')).toBe('a.mcap');
});

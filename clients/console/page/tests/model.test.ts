import {describe, expect, it} from 'vitest';
import {shareWithin} from '../src/model/latency';
import {feedOf, sourceOf} from '../src/model/names';
import {condition, freshness, readState, severity, standing} from '../src/model/state';
import {duration, fixed, micros} from '../src/parts/text';
import {otherText, worstText} from '../src/views/device_status';
import {readRun} from '../src/store/calibration';

describe('names', () => {
  it('have the source that C++ gives them', () => {
    expect(sourceOf('lab/arm0')).toBe(3571832195); // As in tests/fixtures/recorded.json.
  });

  it('are found in the topics of the console and of recordings', () => {
    const names = ['lab/arm0'];
    expect(feedOf('lab/arm0/sample', names)).toEqual({kind: 'sample', device: 'lab/arm0'});
    expect(feedOf('lab/arm0/sampled', names)).toEqual({kind: 'sample', device: 'lab/arm0'});
    expect(feedOf('rtpm.device.Sampled/3571832195', names)).toEqual({
      kind: 'sample',
      device: 'lab/arm0',
    });
    expect(feedOf('rtpm.touch.Touched/3571832195', names)).toEqual({
      kind: 'touch',
      device: 'lab/arm0',
    });
    expect(feedOf('rtpm.touch.Touched/5', names)).toEqual({kind: 'touch', device: 'source 5'});
    expect(feedOf('console/state', names)).toBeNull();
  });
});

describe('state', () => {
  it('says of a device whether it is live, stale or lost', () => {
    const devices = readState({
      devices: [
        {name: 'a', ok: true, age_ms: 4},
        {name: 'b', ok: true, age_ms: 1200},
        {name: 'c', ok: true, age_ms: null},
        {name: 'd', ok: false, age_ms: 3},
      ],
    }).devices;
    expect(devices.map(freshness)).toEqual(['live', 'stale', 'stale', 'lost']);
  });

  it('counts devices by their worst condition, and takes the worst of all', () => {
    const devices = readState({
      devices: [
        {name: 'well', ok: true, age_ms: 4},
        {name: 'in fault', ok: true, age_ms: 4, lifecycle: 'active', faults: ['too fast']},
        {name: 'given up', ok: true, age_ms: 4, lifecycle: 'fault'},
        {name: 'stopped', ok: true, age_ms: 4, is_stopped: true, faults: ['emergency stop']},
        {name: 'gone', ok: false, age_ms: 4, is_stopped: true, lost_for_s: 12},
      ],
    }).devices;
    expect(devices.map(condition)).toEqual(['good', 'fault', 'fault', 'stopped', 'lost']);
    const all = standing(devices);
    expect(all).toEqual({
      worst: 'lost',
      counts: {lost: 1, stopped: 1, fault: 2, stale: 0, good: 1},
    });
    expect(severity(all.worst)).toBe('bad');
    expect(worstText(all)).toBe('1 lost');
    expect(otherText(all)).toBe('1 in emergency stop, 2 in fault, 1 of 5 live');
    expect(worstText(standing(devices.slice(0, 1)))).toBe('1 of 1 live');
    expect(severity(standing(devices.slice(0, 2)).worst)).toBe('bad');
    expect(severity(standing(devices.slice(3, 4)).worst)).toBe('bad');
    expect(worstText(standing([]))).toBe('none');
  });

  it('has the devices that a stop has not reached', () => {
    const missing = {device: 'lab/arm0', url: 'rtpm://h:1/lab/arm0', why: 'no answer', since_s: 3};
    expect(readState({not_stopped: [missing]}).notStopped).toEqual([
      {device: 'lab/arm0', url: 'rtpm://h:1/lab/arm0', why: 'no answer', sinceS: 3},
    ]);
  });

  it('bears anything', () => {
    for (const odd of [null, 3, 'x', [], {devices: 3}, {devices: [null, {axes: 'x'}]}]) {
      expect(readState(odd).replay).toBeNull();
    }
  });
});

describe('latency', () => {
  it('has its share within a bound', () => {
    const bins = [
      {fromUs: 10, toUs: 50, count: 60},
      {fromUs: 50, toUs: 100, count: 40},
    ];
    expect(shareWithin(bins, 50)).toBeCloseTo(0.6);
    expect(shareWithin(bins, 75)).toBeCloseTo(0.8);
    expect(shareWithin([], 50)).toBeNull();
  });
});

describe('calibrations', () => {
  it('come with enums by name, by number, or absent', () => {
    expect(readRun({run: 3, phase: 'Prompt', answers: ['go']}).phase).toBe('Prompt');
    expect(readRun({run: 3, phase: 2, progress: 7})).toMatchObject({phase: 'Done', progress: 1});
    expect(readRun({run: 3}).phase).toBe('Running');
  });
});

describe('text', () => {
  it('is as people read numbers and times', () => {
    expect([fixed(-0.001, 1), fixed(null, 1), fixed(-2, 0)]).toEqual(['0.0', '–', '−2']);
    expect([duration(0.0025), duration(0.004), duration(75), duration(7300)]).toEqual([
      '2.5 ms',
      '4 ms',
      '1 min 15 s',
      '2 h 1 min',
    ]);
    expect([micros(46.2), micros(1320)]).toEqual(['46 µs', '1.32 ms']);
  });
});

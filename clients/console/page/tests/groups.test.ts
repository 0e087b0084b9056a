import {describe, expect, it} from 'vitest';
import {folderOf, groupsOf, laboratoryOf, slowestFirst} from '../src/model/groups';
import {condition, readState, type Device} from '../src/model/state';

const devices = readState({
  devices: [
    {name: 'lab/arm10', ok: true, age_ms: 4, class: 'Haptic'},
    {name: 'lab/arm2', ok: true, age_ms: 4, class: 'Haptic'},
    {name: 'cell2/left/gaze0', ok: true, age_ms: 4, faults: ['too fast'], model: 'Eye 3'},
    {name: 'cell2/left/knob0', ok: true, age_ms: 4},
    {name: 'cell10/arm0', ok: false, lost_for_s: 3},
    {name: 'free', ok: true, age_ms: 4},
  ],
}).devices;

const shown = (search: string, wordOf: (device: Device) => string = condition) =>
  groupsOf(devices, search, wordOf).map((group) => [
    group.folder,
    group.devices.map((one) => one.name.slice(one.name.lastIndexOf('/') + 1)).join(),
    group.standing.worst,
  ]);

describe('many devices', () => {
  it('stand by folder, the worst first, numbers in their order', () => {
    expect(shown('')).toEqual([
      ['cell10', 'arm0', 'lost'],
      ['cell2/left', 'gaze0,knob0', 'fault'],
      ['', 'free', 'good'],
      ['lab', 'arm2,arm10', 'good'],
    ]);
    expect(folderOf('free')).toBe('');
  });

  it('are found by all words of a search, also by their condition as shown', () => {
    expect(shown('HAPTIC lab')).toEqual([['lab', 'arm2,arm10', 'good']]);
    expect(shown('eye')).toEqual([['cell2/left', 'gaze0', 'fault']]);
    expect(shown('fast')).toHaveLength(1);
    expect(shown('verloren', () => 'verloren')).toHaveLength(4);
    expect(shown('verloren')).toEqual([]);
  });
});

describe('consumers', () => {
  it('stand slowest first', () => {
    const {consumers} = readState({
      hub: {
        consumers: [
          {name: 'quick', lag_ms: 1},
          {name: 'lossy', dropped_count: 7},
          {name: 'unknown', lag_ms: null},
          {name: 'slow', host: 'nb', lag_ms: 900, waiting: 12, dropped_count: 3},
          {name: 'behind', lag_ms: 1, waiting: 4},
        ],
      },
    }).hub;
    expect(slowestFirst(consumers).map((one) => one.name)).toEqual([
      'slow',
      'behind',
      'quick',
      'lossy',
      'unknown',
    ]);
    expect(consumers[0]?.lagMs).toBe(1);
    expect(consumers[2]?.lagMs).toBeNull();
  });
});

describe('servers', () => {
  it('are of this laboratory if an address at the registry has their port', () => {
    const state = readState({
      registry: {url: 'rtpm://127.0.0.1:7420/rtpm/names'},
      objects: [{name: 'lab/arm0', url: 'rtpm://[::1]:7421,10.0.0.5:7500/lab/arm0'}],
      servers: [7420, 7421, 7500, 742, 4200].map((port) => ({name: `s${port}`, port})),
    });
    const {ours, others} = laboratoryOf(state);
    expect(ours.map((one) => one.port)).toEqual([7420, 7421, 7500]);
    expect(others.map((one) => one.port)).toEqual([742, 4200]);
  });
});

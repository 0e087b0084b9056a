// A system that moves: an arm that strokes a ball, three more devices, parameters, a calibration.
import {readFileSync} from 'node:fs';

const kBall = {face: 0.012, radius: 0.03};
const kAxes = ['x', 'y', 'z'].map((name) => ({name, is_sensed: true, is_actuated: true}));

function device(name, model, kind, more = {}) {
  return {
    name,
    model,
    serial: `sim-${name.slice(4)}`,
    class: kind,
    url: `rtpm://127.0.0.1:7421/${name}`,
    ok: true,
    problem: '',
    age_ms: 4,
    lifecycle: 'active',
    faults: [],
    success_rate: 1,
    sample_per_s: 1000,
    rate_hz: 1000,
    force_newton_max: 0,
    workspace_low_m: [0, 0, 0],
    workspace_high_m: [0, 0, 0],
    axes: [],
    buttons: [],
    analogs: [],
    joints: [],
    outputs: [],
    lease: {state: 'free', since_s: null},
    is_stopped: false,
    has_config: true,
    lost_for_s: null,
    ...more,
  };
}

function parameter(name, unit, low, high, value, description, more = {}) {
  const real = {type: 'Real', real: value};
  return {
    name,
    type: 'Real',
    unit,
    low,
    high,
    default_value: real,
    value: real,
    description,
    mutability: 'AnyTime',
    ...more,
  };
}

function arm_list() {
  const text = readFileSync(
    new URL('../tests/fixtures/arm_config_list.json', import.meta.url),
    'utf8',
  );
  return JSON.parse(
    text.replaceAll(/: (-?)inf/g, ': $11e308').replace(/"revision": \d+/, '"revision": 7'),
  );
}

const kCrowd = [
  ['arm', 'RTPM simulated arm', 'Haptic', 1000],
  ['gaze', 'RTPM simulated gaze', 'Tracker', 250],
  ['biometric', 'RTPM simulated biometrics', 'Biometric', 250],
  ['knob', 'RTPM simulated knob', 'Dial', 1000],
];

/** One of many devices: most are well. */
function crowded(i) {
  const [kind, model, className, rate] = kCrowd[i % kCrowd.length];
  const one = device(`cell${1 + (i % 9)}/${kind}${10 + i}`, model, className, {
    rate_hz: rate,
    sample_per_s: rate,
    has_config: false,
    force_newton_max: className === 'Haptic' ? 9 : 0,
  });
  if (i % 61 === 20) {
    const problem = 'its name has expired: its server hangs, is dead, or is cut off';
    Object.assign(one, {ok: false, lost_for_s: 12, problem});
  }
  if (i % 47 === 10) Object.assign(one, {lifecycle: 'fault', faults: ['too fast']});
  if (i % 31 === 7) Object.assign(one, {sample_per_s: 0.7 * rate});
  if (i % 29 === 3) Object.assign(one, {age_ms: 2400, sample_per_s: 0});
  if (i % 5 === 1) one.lease = {state: 'held', since_s: 60 + i, ends_in_s: null};
  return one;
}

export class System {
  devices = [
    device('lab/arm0', 'RTPM simulated arm', 'Haptic', {
      axes: kAxes,
      buttons: ['stylus'],
      force_newton_max: 9,
      workspace_low_m: [-0.1, -0.1, -0.1],
      workspace_high_m: [0.1, 0.1, 0.1],
    }),
    device('lab/gaze0', 'RTPM simulated gaze', 'Tracker', {
      rate_hz: 250,
      sample_per_s: 250,
      axes: ['rx', 'ry'].map((name) => ({name, is_sensed: true, is_actuated: false})),
      analogs: [{name: 'pupil', unit: 'm', low: 0, high: 0.01}],
    }),
    device('lab/biometric0', 'RTPM simulated biometrics', 'Biometric', {
      rate_hz: 250,
      sample_per_s: 250,
      analogs: [
        {name: 'pulse', unit: 'Hz', low: 0, high: 4},
        {name: 'skin_conductance', unit: 'S', low: 0, high: 50e-6},
      ],
    }),
    device('lab/knob0', 'RTPM simulated knob', 'Dial', {
      joints: [{name: 'dial', unit: 'rad', low: 0, high: 0}],
      buttons: ['push'],
    }),
  ];
  lists = {
    'lab/arm0': {...arm_list(), is_persistent: true},
    'lab/servo': {
      model: 'rtpm-servo',
      serial: 'servo',
      revision: 1,
      is_active: true,
      is_persistent: false,
      is_unsaved: false,
      parameters: [
        parameter('wall.stiffness_newton_per_m', 'N/m', 0, 1250, 600, 'Of the wall.'),
        parameter('wall.damping_newton_s_per_m', 'N s/m', 0, 2.5, 0.5, 'Of the wall.'),
      ],
    },
  };
  run = null;
  sequence = 0;

  /** Devices that a stop has not reached. */
  notStopped = [];

  /** @param count  devices in all, where it is more than there are */
  constructor(count = 0) {
    for (let i = 0; this.devices.length < count; ++i) this.devices.push(crowded(i));
  }

  /** The devices beyond those that have a motion of their own. */
  crowd() {
    return this.devices.filter(({name}) => name.startsWith('cell'));
  }

  consumers() {
    const consumer = (name, host, lag_ms, waiting, delivered_per_s, dropped_count) => ({
      name,
      host,
      lag_ms,
      waiting,
      delivered_per_s,
      dropped_count,
      is_suspended: false,
    });
    const consumers = [
      consumer('rtpm-console', 'lab-pc', 2, 0, 3512, 0),
      consumer('rtpm-servo', 'lab-pc', 0, 0, 1000, 0),
      consumer('analysis.py', 'notebook-3', 840, 512, 96, 20_417),
    ];
    return {consumer_count: consumers.length, consumers};
  }

  lose(name) {
    const problem = 'its name has expired: its server hangs, is dead, or is cut off';
    Object.assign(this.named(name), {ok: false, lost_for_s: 12, problem});
  }

  owe(missing) {
    this.notStopped = missing.map((one) => ({...one, since_s: 3}));
  }

  dismiss(name) {
    this.notStopped = this.notStopped.filter(({device}) => device !== name);
    this.devices = this.devices.filter((one) => one.name !== name || one.lost_for_s === null);
  }

  named(name) {
    return this.devices.find((one) => one.name === name);
  }

  setting(object, name) {
    return this.lists[object].parameters.find((one) => one.name === name).value.real;
  }

  /** The arm, and what it touches, at a time in seconds. */
  arm(time) {
    const position = [
      0.035 * Math.sin(0.9 * time),
      0.03 * Math.sin(1.7 * time),
      kBall.face - 0.002 + 0.02 * Math.sin(0.55 * time),
    ];
    const centre = [0, 0, kBall.face - kBall.radius];
    const offset = position.map((one, i) => one - centre[i]);
    const distance = Math.hypot(...offset);
    const depth = kBall.radius - distance;
    const isInside = depth > 0 && !this.named('lab/arm0').is_stopped;
    const stiffness = this.setting('lab/servo', 'wall.stiffness_newton_per_m');
    const proxy =
      depth > 0 ? offset.map((one, i) => centre[i] + (one / distance) * kBall.radius) : position;
    const force = isInside
      ? offset.map((one) => (one / distance) * Math.min(9, stiffness * depth))
      : [0, 0, 0];
    return {position, proxy, force, face: kBall.face};
  }

  servers() {
    const lane = (name, low, high, busy) => ({
      name,
      band: [low, high],
      schedule: 'fifo',
      wait: 'adaptive',
      calls_per_s: busy,
      drops_per_s: 0,
      longest_cycle_us: 84,
      queued: 0,
      busy: 0,
    });
    return [
      {
        name: 'rtpm-deviced',
        host: 'lab-pc',
        port: 7421,
        process_id: 4021,
        alive: true,
        lanes: [lane('rest', 0, 16383, 12), lane('haptic', 16384, 32767, 2004)],
      },
      {
        name: 'rtpm-registryd',
        host: 'lab-pc',
        port: 7420,
        process_id: 4012,
        alive: true,
        lanes: [lane('names', 0, 32767, 3)],
      },
      {
        name: 'another-program',
        host: 'lab-pc',
        port: 40123,
        process_id: 977,
        alive: true,
        lanes: [lane('calls', 0, 32767, 0)],
      },
    ];
  }

  objects() {
    return [
      ...this.devices.map(({name, url}) => ({name, interface: 'rtpm.device.Device', url})),
      {
        name: 'lab/servo',
        interface: 'rtpm.configuration.Configuration',
        url: 'rtpm://127.0.0.1:7425/lab/servo',
      },
      {name: 'rtpm/events', interface: 'rtpm.events.Hub', url: 'rtpm://127.0.0.1:7421/rtpm/events'},
    ];
  }

  latency(targets) {
    const bins = [];
    for (let from = 10; from < 3000; from *= 1.25) {
      const spread = (Math.log(from) - Math.log(46)) / 0.32;
      const count = Math.round(1500 * Math.exp((-spread * spread) / 2) + (from > 200 ? 3 : 0));
      bins.push({from_us: from, to_us: from * 1.25, count});
    }
    const wobble = 1 + 0.2 * Math.random();
    return {
      targets: targets.map((name) => ({
        name,
        p50_us: 46 * wobble,
        p90_us: 71 * wobble,
        p99_us: 139 * wobble,
        p999_us: 655,
        max_us: 1320,
        count: 6000,
        failed_count: 0,
        histogram: bins,
      })),
    };
  }

  /** Methods of NAME/config, as schema/idl/configuration.fbs has them. */
  configure(name, method, request) {
    const list = this.lists[name];
    const done = {answer: {outcome: 'Done'}};
    switch (method) {
      case 'list':
        return list;
      case 'save':
        if (!list.is_persistent) {
          return {
            answer: {
              outcome: 'NotPersistent',
              what: name,
              why: 'its server has no folder to ' + 'save to',
              remedy: 'start it with --settings FOLDER.',
            },
          };
        }
        list.is_unsaved = false;
        return done;
      case 'apply':
        return this.apply(name, list, request);
      case 'reset': {
        const names = request.names ?? list.parameters.map((one) => one.name);
        for (const one of list.parameters) {
          if (names.includes(one.name)) one.value = one.default_value;
        }
        ++list.revision;
        return {...done, revision: list.revision, settings: []};
      }
      case 'calibrations':
        return {
          calibrations:
            name !== 'lab/arm0'
              ? []
              : [
                  {
                    name: 'encoder_offset',
                    description:
                      'Finds encoder.offset_m: put the arm at rest in its home position.',
                  },
                ],
          run: this.run?.run ?? 0,
        };
      default:
        return this.calibrate(method, request);
    }
  }

  apply(name, list, request) {
    if (request.revision !== list.revision) {
      return {
        answer: {outcome: 'StaleRevision', what: name},
        revision: list.revision,
        settings: [],
      };
    }
    for (const {name: wanted, value} of request.settings) {
      const one = list.parameters.find((candidate) => candidate.name === wanted);
      // Stands for a rule that no range says.
      if (
        wanted === 'safety.force_newton_continuous' &&
        value.real >
          this.lists[name].parameters.find(
            (candidate) => candidate.name === 'safety.force_newton_max',
          ).value.real
      ) {
        return {
          answer: {
            outcome: 'RefusedByDevice',
            parameter: wanted,
            what: wanted,
            why: 'it is above safety.force_newton_max',
            remedy: 'choose a smaller force.',
          },
        };
      }
      one.value = {...one.value, ...value};
    }
    ++list.revision;
    list.is_unsaved = true;
    return {answer: {outcome: 'Done'}, revision: list.revision, settings: request.settings};
  }

  calibrate(method, request) {
    const done = {answer: {outcome: 'Done'}};
    const now = Date.now();
    if (method === 'calibrate') {
      this.run = {
        run: 41,
        name: request.name,
        phase: 'Prompt',
        progress: 0,
        prompt: 1,
        text: 'Put the arm at rest in its home position, then continue.',
        answers: ['continue', 'cancel'],
        since: now,
      };
    } else if (method === 'answer') {
      Object.assign(
        this.run,
        request.text === 'continue'
          ? {phase: 'Running', answers: [], text: '', since: now}
          : {phase: 'Failed', answers: [], text: 'cancelled by the operator'},
      );
    } else if (method === 'keep' || method === 'discard') {
      this.run.phase = method === 'keep' ? 'Kept' : 'Discarded';
    } else if (this.run?.phase === 'Running') {
      this.run.progress = Math.min(1, (now - this.run.since) / 2000);
      if (this.run.progress === 1) {
        Object.assign(this.run, {
          phase: 'Done',
          text: 'The offset is 0.4 mm from the present one.',
          settings: [
            {name: 'encoder.offset_m', value: {type: 'Vector', elements: [0.0004, 0, -0.0001]}},
          ],
        });
      }
    }
    const reply = {...done, ...this.run};
    if (this.run && ['Kept', 'Discarded', 'Failed'].includes(this.run.phase)) this.run = null;
    return reply;
  }
}

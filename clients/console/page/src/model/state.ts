import type {Medium} from './picture';
import {
  flag,
  list,
  number,
  numberOrNull,
  numbers,
  object,
  objects,
  text,
  texts,
} from '../protocol/fields';
import type {Json, JsonObject} from '../protocol/json';

/** The whole system, as the console sees it: `console/state`. */

export interface Lane {
  readonly name: string;
  readonly band: readonly number[];
  readonly schedule: string;
  readonly wait: string;
  readonly callsPerSecond: number;
  readonly dropsPerSecond: number;
  readonly longestCycleUs: number | null;
  readonly queued: number;
  readonly busy: number;
}

export interface Server {
  readonly name: string;
  readonly host: string;
  readonly port: number;
  readonly processId: number;
  readonly isAlive: boolean;
  readonly lanes: readonly Lane[];
}

export interface Scale {
  readonly name: string;
  readonly unit: string;
  readonly low: number;
  readonly high: number;
}

export interface Axis {
  readonly name: string;
  readonly isSensed: boolean;
}

export interface Device {
  readonly name: string;
  readonly model: string;
  readonly serial: string;
  readonly className: string;
  readonly url: string;
  readonly isOk: boolean;
  readonly problem: string;
  readonly ageMs: number | null;
  readonly lifecycle: string;
  readonly faults: readonly string[];
  readonly successRate: number | null;
  readonly samplesPerSecond: number;
  readonly rateHz: number;
  readonly forceMaxNewton: number;
  readonly workspaceLowM: readonly number[];
  readonly workspaceHighM: readonly number[];
  readonly axes: readonly Axis[];
  readonly buttons: readonly string[];
  readonly analogs: readonly Scale[];
  readonly joints: readonly Scale[];
  readonly outputs: readonly Scale[];
  readonly lease: {
    readonly state: string;
    readonly sinceS: number | null;
    /** The browser that operates the device is gone; null: the lease lasts until released. */
    readonly endsInS: number | null;
    /** Name and host of another program; empty where it has not said. */
    readonly holder: string;
    readonly operator: LeaseOperator | null;
    readonly request: LeaseRequest | null;
  };
  readonly isStopped: boolean;
  readonly hasConfig: boolean;
  /** Its name has expired, so long ago; null: it is bound. */
  readonly lostForS: number | null;
}

/** For whom the console holds a lease. */
export interface LeaseOperator {
  readonly connection: number;
  /** Empty: not said. */
  readonly name: string;
  readonly room: string;
  readonly sinceNs: number;
  readonly isGone: boolean;
  /** Also while the browser is gone. */
  readonly isKept: boolean;
}

/** Another operator asks for a device. */
export interface LeaseRequest {
  readonly connection: number;
  readonly name: string;
  readonly room: string;
  readonly endsInS: number;
}

/** Incidents in numbers. */
export interface IncidentState {
  readonly openCount: number;
  /** Warnings and alarms that nobody has acknowledged. */
  readonly unseenCount: number;
  /** The newest alarm among them; 0: none. */
  readonly unseenAlarm: number;
  readonly isKept: boolean;
  /** Why the file is not written; empty: it is. */
  readonly problem: string;
  /** Lines of the file that could not be read. */
  readonly tornCount: number;
}

/** A device that an emergency stop has not reached: it is delivered when the device answers. */
export interface NotStopped {
  readonly device: string;
  readonly url: string;
  readonly why: string;
  readonly sinceS: number;
}

export interface Session {
  readonly participant: string;
  readonly experiment: string;
  readonly condition: string;
  readonly notes: string;
}

export interface Recording {
  readonly file: string | null;
  readonly timeS: number;
  readonly messageCount: number;
  readonly byteCount: number;
  readonly dropCount: number;
  readonly problem: string;
  /** The experiment, as the recording states it. */
  readonly session: Session | null;
  /** Sentences about what is not recorded. */
  readonly missing: readonly string[];
}

export interface Replay {
  readonly file: string;
  readonly beginNs: number;
  readonly endNs: number;
  readonly timeNs: number;
  readonly speed: number;
  readonly isPlaying: boolean;
  readonly topics: readonly string[];
}

/** A subscription at the hub: a program that receives events. */
export interface Consumer {
  readonly name: string;
  /** Its program and process, "rtpm 4711"; empty: it does not say. */
  readonly program: string;
  readonly host: string;
  /** How late events reach it; null: not known. */
  readonly lagMs: number | null;
  /** Events that wait for it. */
  readonly waitingCount: number;
  readonly deliveredPerSecond: number;
  /** Events that it missed since it subscribed. */
  readonly droppedCount: number;
  readonly isSuspended: boolean;
}

export interface ConsoleState {
  readonly timeNs: number;
  readonly uptimeS: number;
  readonly registry: {readonly url: string; readonly isOk: boolean; readonly problem: string};
  readonly hub: {
    readonly name: string;
    readonly isOk: boolean;
    readonly problem: string;
    readonly consumerCount: number;
    readonly consumers: readonly Consumer[];
    readonly eventsPerSecond: number;
  };
  readonly servers: readonly Server[];
  readonly objects: readonly {
    readonly name: string;
    readonly interface: string;
    readonly url: string;
  }[];
  readonly devices: readonly Device[];
  readonly media: readonly Medium[];
  readonly notStopped: readonly NotStopped[];
  readonly recording: Recording;
  readonly replay: Replay | null;
  readonly incidents: IncidentState;
  readonly clients: {readonly count: number; readonly droppedCount: number};
  /** The memory in which the console keeps the past; null: it keeps none. */
  readonly history: {
    readonly byteCount: number;
    readonly byteMax: number;
    readonly fieldCount: number;
    /** Fields whose past did not fit. */
    readonly droppedCount: number;
  } | null;
  /** Events of the hub on their way to browsers. */
  readonly events: {
    readonly channelCount: number;
    readonly channelCountMax: number;
    /** Counts sources that have no channel, because there are too many. */
    readonly omittedCount: number;
    /** Not shown, because the console was too busy. */
    readonly droppedCount: number;
  };
}

/** Whether the device senses where it is, and which way it is turned; unknown devices may. */
export function sensesPlace(device: Device | null): boolean {
  return device === null || device.axes.some((one) => one.isSensed && /^[xyz]$/.test(one.name));
}
export function sensesTurn(device: Device | null): boolean {
  return device?.axes.some((one) => one.isSensed && /^r[xyz]$/.test(one.name)) ?? false;
}

/** A device whose newest sample is older is stale. */
export const kStaleMs = 1000;

export type Freshness = 'live' | 'stale' | 'lost';

export function freshness(device: Device): Freshness {
  if (!device.isOk) return 'lost';
  return device.ageMs === null || device.ageMs > kStaleMs ? 'stale' : 'live';
}

/** The conditions of a device, the worst first. */
export const kConditions = ['lost', 'stopped', 'fault', 'stale', 'good'] as const;
export type Condition = (typeof kConditions)[number];

/** The worst of a device. */
export function condition(device: Device): Condition {
  const state = freshness(device);
  if (state === 'lost') return 'lost';
  if (device.isStopped) return 'stopped';
  if (device.faults.length > 0 || device.lifecycle === 'fault') return 'fault';
  return state === 'stale' ? 'stale' : 'good';
}

export function severity(one: Condition): 'good' | 'warn' | 'bad' {
  if (one === 'good') return 'good';
  return one === 'stale' ? 'warn' : 'bad';
}

/** How the devices are, all together. */
export interface Standing {
  readonly worst: Condition;
  readonly counts: Readonly<Record<Condition, number>>;
}

export function standing(devices: readonly Device[]): Standing {
  const counts = {lost: 0, stopped: 0, fault: 0, stale: 0, good: 0};
  for (const device of devices) ++counts[condition(device)];
  return {worst: kConditions.find((one) => counts[one] > 0) ?? 'good', counts};
}

export function readState(value: Json): ConsoleState {
  const state = object(value);
  const registry = object(state['registry']);
  const hub = object(state['hub']);
  const clients = object(state['clients']);
  const events = object(state['events']);
  return {
    timeNs: number(state['time_ns']),
    uptimeS: number(state['uptime_s']),
    registry: {
      url: text(registry['url']),
      isOk: flag(registry['ok']),
      problem: text(registry['problem']),
    },
    hub: {
      name: text(hub['name']),
      isOk: flag(hub['ok']),
      problem: text(hub['problem']),
      consumerCount: number(hub['consumer_count']),
      consumers: objects(hub['consumers']).map((one) => ({
        name: text(one['name']),
        program: text(one['program']),
        host: text(one['host']),
        lagMs: numberOrNull(one['lag_ms']),
        waitingCount: number(one['waiting']),
        deliveredPerSecond: number(one['delivered_per_s']),
        droppedCount: number(one['dropped_count']),
        isSuspended: flag(one['is_suspended']),
      })),
      eventsPerSecond: number(hub['event_per_s']),
    },
    servers: list(state['servers']).map((one) => readServer(object(one))),
    objects: objects(state['objects']).map((one) => ({
      name: text(one['name']),
      interface: text(one['interface']),
      url: text(one['url']),
    })),
    devices: list(state['devices']).map((one) => readDevice(object(one))),
    media: objects(state['media']).map((one) => ({
      name: text(one['name']),
      widthPx: number(one['width_px']),
      heightPx: number(one['height_px']),
      rateHz: number(one['rate_hz']),
      uncertaintyNs: number(one['uncertainty_ns']),
      problem: text(one['problem']),
    })),
    notStopped: objects(state['not_stopped']).map((one) => ({
      device: text(one['device']),
      url: text(one['url']),
      why: text(one['why']),
      sinceS: number(one['since_s']),
    })),
    recording: readRecording(object(state['recording'])),
    replay: readReplay(object(state['replay'])),
    incidents: readIncidentState(object(state['incidents'])),
    clients: {count: number(clients['count']), droppedCount: number(clients['dropped_count'])},
    history: state['history'] === undefined ? null : readHistory(object(state['history'])),
    events: {
      channelCount: number(events['channel_count']),
      channelCountMax: number(events['channel_count_max']),
      omittedCount: number(events['omitted_count']),
      droppedCount: number(events['dropped_count']),
    },
  };
}

function readHistory(history: JsonObject): ConsoleState['history'] {
  return {
    byteCount: number(history['byte_count']),
    byteMax: number(history['byte_max']),
    fieldCount: number(history['field_count']),
    droppedCount: number(history['dropped_count']),
  };
}

function readServer(server: JsonObject): Server {
  return {
    name: text(server['name']),
    host: text(server['host']),
    port: number(server['port']),
    processId: number(server['process_id']),
    isAlive: flag(server['alive']),
    lanes: objects(server['lanes']).map((lane) => ({
      name: text(lane['name']),
      band: numbers(lane['band']),
      schedule: text(lane['schedule']),
      wait: text(lane['wait']),
      callsPerSecond: number(lane['calls_per_s']),
      dropsPerSecond: number(lane['drops_per_s']),
      longestCycleUs: numberOrNull(lane['longest_cycle_us']),
      queued: number(lane['queued']),
      busy: number(lane['busy']),
    })),
  };
}

function readScale(value: Json): Scale {
  const scale = object(value);
  return {
    name: text(scale['name']),
    unit: text(scale['unit']),
    low: number(scale['low']),
    high: number(scale['high']),
  };
}

function readDevice(device: JsonObject): Device {
  const lease = object(device['lease']);
  return {
    name: text(device['name']),
    model: text(device['model']),
    serial: text(device['serial']),
    className: text(device['class']).toLowerCase(),
    url: text(device['url']),
    isOk: flag(device['ok']),
    problem: text(device['problem']),
    ageMs: numberOrNull(device['age_ms']),
    lifecycle: text(device['lifecycle'], 'unknown'),
    faults: texts(device['faults']),
    successRate: numberOrNull(device['success_rate']),
    samplesPerSecond: number(device['sample_per_s']),
    rateHz: number(device['rate_hz']),
    forceMaxNewton: number(device['force_newton_max']),
    workspaceLowM: numbers(device['workspace_low_m']),
    workspaceHighM: numbers(device['workspace_high_m']),
    axes: objects(device['axes']).map((axis) => ({
      name: text(axis['name']),
      isSensed: flag(axis['is_sensed']),
    })),
    buttons: texts(device['buttons']),
    analogs: list(device['analogs']).map(readScale),
    joints: list(device['joints']).map(readScale),
    outputs: list(device['outputs']).map(readScale),
    lease: {
      state: text(lease['state'], 'unknown'),
      sinceS: numberOrNull(lease['since_s']),
      endsInS: numberOrNull(lease['ends_in_s']),
      holder: text(lease['holder']),
      operator: readOperator(object(lease['operator'])),
      request: readRequest(object(lease['request'])),
    },
    isStopped: flag(device['is_stopped']),
    hasConfig: flag(device['has_config']),
    lostForS: numberOrNull(device['lost_for_s']),
  };
}

function readOperator(operator: JsonObject): LeaseOperator | null {
  const connection = numberOrNull(operator['connection']);
  if (connection === null) return null;
  return {
    connection,
    name: text(operator['name']),
    room: text(operator['room']),
    sinceNs: number(operator['since_ns']),
    isGone: flag(operator['is_gone']),
    isKept: flag(operator['is_kept']),
  };
}

function readRequest(request: JsonObject): LeaseRequest | null {
  const connection = numberOrNull(request['connection']);
  if (connection === null) return null;
  return {
    connection,
    name: text(request['name']),
    room: text(request['room']),
    endsInS: number(request['ends_in_s']),
  };
}

function readIncidentState(incidents: JsonObject): IncidentState {
  return {
    openCount: number(incidents['open_count']),
    unseenCount: number(incidents['unseen_count']),
    unseenAlarm: number(incidents['unseen_alarm']),
    isKept: flag(incidents['is_kept']),
    problem: text(incidents['problem']),
    tornCount: number(incidents['torn_count']),
  };
}

function readRecording(recording: JsonObject): Recording {
  const file = text(recording['file']);
  return {
    file: file === '' ? null : file,
    timeS: number(recording['time_s']),
    messageCount: number(recording['message_count']),
    byteCount: number(recording['byte_count']),
    dropCount: number(recording['drop_count']),
    problem: text(recording['problem']),
    session: readSession(recording['session']),
    missing: texts(recording['missing']),
  };
}

function readSession(value: Json | undefined): Session | null {
  if (value === null || value === undefined) return null;
  const session = object(value);
  return {
    participant: text(session['participant']),
    experiment: text(session['experiment']),
    condition: text(session['condition']),
    notes: text(session['notes']),
  };
}

function readReplay(replay: JsonObject): Replay | null {
  const file = text(replay['file']);
  if (file === '') return null;
  return {
    file,
    beginNs: number(replay['begin_ns']),
    endNs: number(replay['end_ns']),
    timeNs: number(replay['time_ns']),
    speed: number(replay['speed'], 1),
    isPlaying: flag(replay['is_playing']),
    topics: texts(replay['topics']),
  };
}

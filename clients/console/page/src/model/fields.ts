import type {Channel} from '../protocol/client';
import type {Decoded, DecodedTable} from '../flatbuffers/decode';
import type {Json} from '../protocol/json';
import {sourceOf} from './names';
import {directionOf} from './sample';
import type {Device} from './state';

/** The numbers of events and parameters by their paths: "lab/arm0/sampled.position_m.x". */

export interface FieldPath {
  /** "lab/arm0/sampled", as recordings call it. */
  readonly topic: string;
  /** "position_m.x". */
  readonly field: string;
}

export function splitPath(path: string): FieldPath {
  const dot = path.indexOf('.', path.lastIndexOf('/') + 1);
  if (dot < 0) return {topic: path, field: ''};
  return {topic: path.slice(0, dot), field: path.slice(dot + 1)};
}

/** The device whose field it is, "lab/arm0"; of other sources what stands before the last slash. */
export function subjectOf(path: string): string {
  const {topic} = splitPath(path);
  return topic.slice(0, Math.max(0, topic.lastIndexOf('/')));
}

/** "button_changed", from "rtpm.device.ButtonChanged". */
function snake(type: string): string {
  const name = type.slice(type.lastIndexOf('.') + 1);
  return name.replace(/[A-Z]/g, (one, at: number) => `${at > 0 ? '_' : ''}${one.toLowerCase()}`);
}

/** Where the values of a topic come from now. */
export interface LiveTopic {
  readonly channel: string;
  /** Only these of the changes of a device; empty: every message. */
  readonly change: string;
}

/** null where the topic has no channel at present, as parameters have none. */
export function liveTopicOf(
  topic: string,
  channels: ReadonlyMap<string, Channel>,
): LiveTopic | null {
  const slash = topic.lastIndexOf('/');
  const device = topic.slice(0, Math.max(0, slash));
  const type = topic.slice(slash + 1);
  if (type === 'sampled') {
    const channel = `${device}/sample`;
    return channels.has(channel) ? {channel, change: ''} : null;
  }
  if (channels.has(topic)) return {channel: topic, change: ''};
  if (type === 'config') return null;
  const source = `/${sourceOf(device)}`;
  for (const channel of channels.keys()) {
    if (channel.endsWith(source) && snake(channel.slice(0, -source.length)) === type)
      return {channel, change: ''};
  }
  const changes = `${device}/event`;
  return channels.has(changes) ? {channel: changes, change: type} : null;
}

/** Whether a message of a device's changes is of this kind. */
export function isChange(value: Json | DecodedTable, change: string): boolean {
  const type = (value as {readonly type?: unknown} | null)?.type;
  return typeof type === 'string' && snake(type) === change;
}

type Value = Decoded | Json | undefined;
type Fields = {readonly [key: string]: Value};

function fieldsOf(value: Value): Fields | null {
  return value !== null && typeof value === 'object' && !Array.isArray(value)
    ? (value as Fields)
    : null;
}

/** The field of a table that holds only one struct is left out in paths. */
function inner(value: Value): Value {
  const fields = fieldsOf(value);
  if (fields === null) return value;
  const [key, ...others] = Object.keys(fields);
  const only = key !== undefined && others.length === 0 ? fields[key] : undefined;
  return fieldsOf(only) !== null ? only : value;
}

function partsOf(device: Device | null, array: string): readonly string[] {
  if (device === null) return [];
  switch (array) {
    case 'joints':
    case 'joint_velocities':
    case 'efforts':
      return device.joints.map((one) => one.name);
    case 'outputs':
      return device.outputs.map((one) => one.name);
    case 'analogs':
      return device.analogs.map((one) => one.name);
    case 'button_edges':
      return device.buttons;
    default:
      return [];
  }
}

function real(value: Value): number {
  switch (typeof value) {
    case 'number':
      return value;
    case 'bigint':
      return Number(value);
    case 'boolean':
      return value ? 1 : 0;
    default:
      return NaN;
  }
}

/** Reads one number of a topic's messages; NaN where a message lacks it. */
export type FieldReader = (value: Json | DecodedTable) => number;

function derivedReader(field: string): FieldReader | null {
  const numbers = (value: Json | DecodedTable, name: string, parts: readonly string[]) => {
    const struct = fieldsOf(fieldsOf(inner(value as Value))?.[name]);
    return parts.map((part) => real(struct?.[part]));
  };
  if (field === 'force_newton.total') {
    return (value) => Math.hypot(...numbers(value, 'force_newton', ['x', 'y', 'z']));
  }
  if (field !== 'direction_deg.right' && field !== 'direction_deg.up') return null;
  return (value) => {
    const [x = NaN, y = NaN, z = NaN, w = NaN] = numbers(value, 'orientation', [
      'x',
      'y',
      'z',
      'w',
    ]);
    const {rightDeg, upDeg} = directionOf([x, y, z, w]);
    return field.endsWith('.up') ? upDeg : rightDeg;
  };
}

export function fieldReader(field: string, device: Device | null): FieldReader {
  const derived = derivedReader(field);
  if (derived !== null) return derived;
  const [first = '', ...rest] = field.split('.');
  const part = partsOf(device, first).indexOf(rest.join('.'));
  const steps: (string | number)[] = [];
  if (part >= 0) {
    steps.push(first, part);
  } else {
    for (const step of field.split('.')) {
      const found = /^(.*)\[(\d+)\]$/.exec(step);
      if (found === null) steps.push(step);
      else steps.push(found[1] ?? '', Number(found[2]));
    }
  }
  return (value) => {
    let at: Value = inner(value as Value);
    for (const step of steps) {
      if (typeof step === 'number') at = Array.isArray(at) ? (at[step] as Value) : undefined;
      else at = fieldsOf(at)?.[step];
    }
    return real(at);
  };
}

/** Units by the end of a name, as the console has them; the longest first. */
const kUnits: readonly (readonly [string, string])[] = [
  ['_rad_per_s', 'rad/s'],
  ['_m_per_s2', 'm/s²'],
  ['_m_per_s', 'm/s'],
  ['_newton_metre', 'N m'],
  ['_newton_s_per_m', 'N s/m'],
  ['_newton_per_m', 'N/m'],
  ['_newton', 'N'],
  ['_kelvin', 'K'],
  ['_celsius', '°C'],
  ['_volt', 'V'],
  ['_ampere', 'A'],
  ['_watt', 'W'],
  ['_pascal', 'Pa'],
  ['_percent', '%'],
  ['_deg', '°'],
  ['_ns', 'ns'],
  ['_us', 'µs'],
  ['_ms', 'ms'],
  ['_hz', 'Hz'],
  ['_rad', 'rad'],
  ['_s', 's'],
  ['_m', 'm'],
];

/** The unit that a path has by its device and name, until the console says it. */
export function unitOf(path: string, device: Device | null): string {
  const {field} = splitPath(path);
  const [first = '', ...rest] = field.split('.');
  const scales =
    first === 'analogs' ? device?.analogs : first === 'outputs' ? device?.outputs : device?.joints;
  const unit = scales?.find((one) => one.name === rest.join('.'))?.unit;
  if (unit !== undefined && ['analogs', 'outputs', 'joints'].includes(first)) return unit;
  if (unit !== undefined && first === 'joint_velocities') return `${unit}/s`;
  if (unit !== undefined && first === 'efforts') return unit === 'm' ? 'N' : 'N m';
  for (const name of field.split('.').reverse()) {
    const stem = name.replace(/\[.*/, '');
    const found = kUnits.find(([end]) => stem.endsWith(end));
    if (found !== undefined) return found[1];
  }
  return '';
}

/** Fields of a device that are there without asking the console. */
export function sampleFields(device: Device): string[] {
  const of = (field: string, ends: readonly string[]) => ends.map((end) => `${field}.${end}`);
  const names = [
    ...of('position_m', ['x', 'y', 'z']),
    ...of('orientation', ['x', 'y', 'z', 'w']),
    ...of('direction_deg', ['right', 'up']),
    ...of('linear_m_per_s', ['x', 'y', 'z']),
    ...of('angular_rad_per_s', ['x', 'y', 'z']),
    ...of('force_newton', ['x', 'y', 'z', 'total']),
    ...of('torque_newton_metre', ['x', 'y', 'z']),
    ...of('joints', partsOf(device, 'joints')),
    ...of('joint_velocities', partsOf(device, 'joints')),
    ...of('efforts', partsOf(device, 'joints')),
    ...of('outputs', partsOf(device, 'outputs')),
    ...of('analogs', partsOf(device, 'analogs')),
    'buttons',
    'faults',
    'success_rate',
  ];
  return names.map((name) => `${device.name}/sampled.${name}`);
}

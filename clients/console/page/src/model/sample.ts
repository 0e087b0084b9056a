import type {Decoded, DecodedTable} from '../flatbuffers/decode';
import type {Json} from '../protocol/json';

/** The fields of rtpm.device.Sampled and rtpm.touch.Touched that the page uses. */

export type Vector3 = readonly [number, number, number];

export interface Sample {
  /** The time of the measurement on the device host's clock; 0 if it is not known. */
  readonly hostTimeS: number;
  readonly positionM: Vector3;
  readonly orientation: readonly [number, number, number, number];
  readonly forceNewton: Vector3;
  readonly joints: readonly number[];
  readonly analogs: readonly number[];
  readonly buttons: number;
}

export type Shape = 'plane' | 'sphere' | 'texture';

export interface Touch {
  readonly deviceM: Vector3;
  readonly proxyM: Vector3;
  readonly forceNewton: Vector3;
  readonly faceM: number;
  readonly shape: Shape;
}

const kShapes: readonly Shape[] = ['plane', 'sphere', 'texture'];

type Value = Decoded | Json | undefined;

function table(value: Value): DecodedTable | null {
  return value !== null && typeof value === 'object' && !Array.isArray(value)
    ? (value as DecodedTable)
    : null;
}

function real(value: Value): number {
  return typeof value === 'bigint' ? Number(value) : typeof value === 'number' ? value : 0;
}

function reals(value: Value): number[] {
  return Array.isArray(value) ? value.map(real) : [];
}

function vector(value: Value): Vector3 {
  const fields = table(value);
  return [real(fields?.['x']), real(fields?.['y']), real(fields?.['z'])];
}

export interface Direction {
  readonly rightDeg: number;
  readonly upDeg: number;
}

/** Where the -z axis points after the turn: a gaze, or what a pointer aims at. */
export function directionOf([x, y, z, w]: Sample['orientation']): Direction {
  const right = -2 * (x * z + w * y);
  const up = -2 * (y * z - w * x);
  const ahead = 1 - 2 * (x * x + y * y);
  const kDegrees = 180 / Math.PI;
  return {
    rightDeg: kDegrees * Math.atan2(right, ahead),
    upDeg: kDegrees * Math.atan2(up, Math.hypot(right, ahead)),
  };
}

export function length(vector: Vector3): number {
  return Math.hypot(vector[0], vector[1], vector[2]);
}

/** null where the payload has no sample. */
export function readSample(value: DecodedTable | Json): Sample | null {
  const sample = table(table(value)?.['sample']);
  if (sample === null) return null;
  const turn = table(sample['orientation']);
  return {
    hostTimeS: real(sample['host_time_ns']) / 1e9,
    positionM: vector(sample['position_m']),
    orientation: [real(turn?.['x']), real(turn?.['y']), real(turn?.['z']), real(turn?.['w'])],
    forceNewton: vector(sample['force_newton']),
    joints: reals(sample['joints']),
    analogs: reals(sample['analogs']),
    buttons: real(sample['buttons']),
  };
}

/** null where the payload has no state of a touch. */
export function readTouch(value: DecodedTable | Json): Touch | null {
  const state = table(table(value)?.['state']);
  if (state === null) return null;
  return {
    deviceM: vector(state['device_m']),
    proxyM: vector(state['proxy_m']),
    forceNewton: vector(state['force_newton']),
    faceM: real(state['face_m']),
    shape: kShapes[real(state['shape'])] ?? 'plane',
  };
}

import type {Device, Scale} from './state';
import {sensesPlace, sensesTurn} from './state';
import {list, number, object, text, texts} from '../protocol/fields';
import {parseJson, type Json} from '../protocol/json';

/** Which plots are shown, and which curves in each. */

export type Side = 'above' | 'below';

/** A line at a value; curves of its unit that pass it are told. */
export interface Threshold {
  /** In the unit without a prefix. */
  readonly value: number;
  readonly unit: string;
  readonly label: string;
  /** Where it is passed. */
  readonly side: Side;
}

/** `time`: curves over time. `direction`: where a device points, on a screen. */
export type PlotKind = 'time' | 'direction';

export interface Plot {
  readonly title: string;
  readonly kind: PlotKind;
  /** For `direction`, the name of the device alone. */
  readonly fields: readonly string[];
  readonly thresholds: readonly Threshold[];
}

export interface Layout {
  readonly name: string;
  readonly windowS: number;
  readonly plots: readonly Plot[];
}

export const kWindowMinS = 10;
export const kWindowMaxS = 4 * 3600;
export const kPlotMax = 12;
export const kCurveMax = 16;
/** Curves of all plots of a layout together. */
export const kCurvesInAllMax = 48;
export const kThresholdMax = 8;
export const kNameMax = 60;
const kPathMax = 200;
const kUnitMax = 16;
const kCodeMax = 16384;

/** Foreign text for a layout: one line, and not too long. */
export function plain(value: string, sizeMax: number): string {
  // Controls, and marks that turn the direction of what follows.
  return value
    .replace(/[\p{Cc}\p{Cf}\u2028\u2029]/gu, ' ')
    .trim()
    .slice(0, sizeMax);
}

function readThreshold(value: Json): Threshold | null {
  const one = object(value);
  const at = number(one['value'], NaN);
  if (!Number.isFinite(at)) return null;
  return {
    value: at,
    unit: plain(text(one['unit']), kUnitMax),
    label: plain(text(one['label']), kNameMax),
    side: one['side'] === 'below' ? 'below' : 'above',
  };
}

function readPlot(value: Json, left: {count: number}): Plot {
  const one = object(value);
  const fields = [...new Set(texts(one['fields']))]
    .filter((path) => path.length <= kPathMax && plain(path, kPathMax) === path && path !== '')
    .slice(0, Math.min(kCurveMax, left.count));
  left.count -= fields.length;
  return {
    title: plain(text(one['title']), kNameMax),
    kind: one['kind'] === 'direction' ? 'direction' : 'time',
    fields,
    thresholds: list(one['thresholds'])
      .slice(0, kThresholdMax)
      .map(readThreshold)
      .filter((threshold) => threshold !== null),
  };
}

/** A layout from outside, with what it may not have left out; null where it is none. */
export function readLayout(value: Json): Layout | null {
  const one = object(value);
  if (!Array.isArray(one['plots'])) return null;
  const left = {count: kCurvesInAllMax};
  return {
    name: plain(text(one['name']), kNameMax),
    windowS: Math.min(kWindowMaxS, Math.max(kWindowMinS, number(one['windowS'], 30))),
    plots: list(one['plots'])
      .slice(0, kPlotMax)
      .map((plot) => readPlot(plot, left)),
  };
}

/** The layout as a part of a URL. */
export function encode(layout: Layout): string {
  const bytes = new TextEncoder().encode(JSON.stringify(layout));
  const binary = Array.from(bytes, (byte) => String.fromCharCode(byte)).join('');
  return btoa(binary).replaceAll('+', '-').replaceAll('/', '_').replace(/=+$/, '');
}

/** null where `code` is no layout. */
export function decode(code: string): Layout | null {
  if (code.length > kCodeMax || !/^[\w-]+$/.test(code)) return null;
  try {
    const binary = atob(code.replaceAll('-', '+').replaceAll('_', '/'));
    const bytes = Uint8Array.from(binary, (one) => one.charCodeAt(0));
    return readLayout(parseJson(new TextDecoder('utf-8', {fatal: true}).decode(bytes)));
  } catch {
    return null;
  }
}

/** The plots that show devices of this class at best. */
export function deviceLayout(device: Device): Layout {
  const {name} = device;
  const path = (field: string) => `${name}/sampled.${field}`;
  const of = (field: string, ends: readonly string[]) => ends.map((end) => path(`${field}.${end}`));
  const plots: Plot[] = [];
  const add = (title: string, fields: readonly string[], kind: PlotKind = 'time') => {
    if (fields.length > 0 && plots.length < kPlotMax)
      plots.push({title, kind, fields: fields.slice(0, kCurveMax), thresholds: []});
  };
  // Each quantity has an axis, two to a plot: left and right.
  const addScales = (field: string, scales: readonly Scale[]) => {
    const units = [...new Set(scales.map((one) => one.unit))];
    for (let i = 0; i < units.length; i += 2) {
      const shown = scales.filter((one) => units.slice(i, i + 2).includes(one.unit));
      add(
        shown.map((one) => one.name).join(', '),
        of(
          field,
          shown.map((one) => one.name),
        ),
      );
    }
  };
  if (sensesTurn(device)) {
    if (!sensesPlace(device)) add('Direction', [name], 'direction');
    add('Direction', of('direction_deg', ['right', 'up']));
  }
  if (sensesPlace(device)) add('Position', of('position_m', ['x', 'y', 'z']));
  if (device.forceMaxNewton > 0) add('Force', of('force_newton', ['x', 'y', 'z', 'total']));
  if (device.className === 'poser') add('Velocity', of('linear_m_per_s', ['x', 'y', 'z']));
  addScales('joints', device.joints);
  if (device.className === 'dial' && device.joints.length > 0) {
    const joints = device.joints.map((one) => one.name);
    add('Velocity, effort', [...of('joint_velocities', joints), ...of('efforts', joints)]);
  }
  addScales('outputs', device.outputs);
  addScales('analogs', device.analogs);
  if (plots.length === 0) add('Buttons', [path('buttons')]);
  return {name, windowS: 30, plots};
}

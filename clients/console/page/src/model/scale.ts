import {angle, type Angle} from '../store/settings';
import type {Scale} from './state';

/** How the values of a channel are shown: 5e-6 S as 5.00 µS. */
export interface ShownScale {
  readonly unit: string;
  /** From the channel's unit to the shown one. */
  readonly factor: number;
  readonly digits: number;
}

/** SI units that take prefixes; minutes or turns do not. */
const kPrefixed: ReadonlySet<string> = new Set([
  ...['m', 's', 'S', 'V', 'A', 'N', 'W', 'Pa', 'N m', 'Hz', 'J', 'rad'],
  ...['m/s', 'm/s²', 'rad/s', 'N/m', 'N s/m', 'B', 'Ω'],
]);
const kPrefixes = [
  {prefix: '', factor: 1},
  {prefix: 'm', factor: 1e3},
  {prefix: 'µ', factor: 1e6},
  {prefix: 'n', factor: 1e9},
] as const;
const kGreater = [
  {prefix: 'G', factor: 1e-9},
  {prefix: 'M', factor: 1e-6},
  {prefix: 'k', factor: 1e-3},
] as const;

/** A scale that remembers its prefix. */
export interface SizedScale extends ShownScale {
  readonly prefix: {readonly prefix: string; readonly factor: number};
  readonly shownUnit: string;
}

/** The factor and prefix with which a value of this size has one to three digits before the point. */
export function prefixFor(size: number, unit: string): {prefix: string; factor: number} {
  if (!kPrefixed.has(unit) || !Number.isFinite(size) || size <= 0) return kPrefixes[0];
  // Nobody reads kiloseconds.
  const greater = unit === 's' ? undefined : kGreater.find(({factor}) => size * factor >= 1);
  return greater ?? kPrefixes.find(({factor}) => size * factor >= 1) ?? kPrefixes[3];
}

/** Units of angles, and of what is made of them, as they were measured and as they are shown. */
const kAngles: readonly Readonly<Record<Angle, string>>[] = [
  {degrees: '°', radians: 'rad'},
  {degrees: '°/s', radians: 'rad/s'},
  {degrees: '°/s²', radians: 'rad/s²'},
];

/** The unit of an angle as chosen, and the factor to it. */
export function shownAngle(unit: string): {readonly unit: string; readonly factor: number} {
  const written = unit.replace('deg', '°').replace('s^2', 's²');
  const wanted = angle.value;
  const pair = kAngles.find((one) => one.degrees === written || one.radians === written);
  if (pair === undefined || pair[wanted] === written) return {unit, factor: 1};
  return {unit: pair[wanted], factor: wanted === 'degrees' ? 180 / Math.PI : Math.PI / 180};
}

/**
 * By the size of what is shown. The prefix changes only where the one before does not fit any more,
 * so that it does not flicker.
 */
export function sizedScale(unit: string, size: number, before?: SizedScale): SizedScale {
  const {unit: plainUnit, factor} = shownAngle(unit);
  const shownUnit = plainUnit === '1' ? '' : plainUnit;
  const shown = size * factor;
  const isSame = before?.shownUnit === shownUnit;
  const kept = isSame ? shown * before.prefix.factor : 0;
  const prefix = isSame && kept >= 0.5 && kept < 1500 ? before.prefix : prefixFor(shown, shownUnit);
  const scaled = shown * prefix.factor;
  return {
    unit: `${prefix.prefix}${shownUnit}`,
    factor: factor * prefix.factor,
    digits: Math.min(4, Math.max(0, 3 - Math.floor(Math.log10(scaled || 1)))),
    prefix,
    shownUnit,
  };
}

/** By the channel's range, so that its unit stays the same whatever the value. */
export function shownScale(scale: Pick<Scale, 'unit' | 'low' | 'high'>): ShownScale {
  const {unit, factor} = shownAngle(scale.unit);
  const range = Math.max(Math.abs(scale.low), Math.abs(scale.high)) * factor;
  const isUsable = Number.isFinite(range) && range > 0;
  const chosen =
    isUsable && kPrefixed.has(unit)
      ? (kPrefixes.find(({factor}) => range * factor >= 1) ?? kPrefixes[3])
      : kPrefixes[0];
  const shown = isUsable ? range * chosen.factor : 1;
  return {
    unit: unit === '1' ? '' : `${chosen.prefix}${unit}`,
    factor: factor * chosen.factor,
    digits: Math.min(3, Math.max(0, 3 - Math.floor(Math.log10(shown)))),
  };
}

/** A channel, and its place among those of its kind. */
export interface PlacedScale {
  readonly scale: Scale;
  readonly index: number;
}

/** The channels that one axis can show: those of one shown unit, in their order. */
export function byUnit(
  scales: readonly Scale[],
): readonly {readonly shown: ShownScale; readonly members: readonly PlacedScale[]}[] {
  const groups = new Map<string, {shown: ShownScale; members: PlacedScale[]}>();
  scales.forEach((scale, index) => {
    const shown = shownScale(scale);
    const group = groups.get(shown.unit) ?? {shown, members: []};
    group.members.push({scale, index});
    groups.set(shown.unit, group);
  });
  return [...groups.values()];
}

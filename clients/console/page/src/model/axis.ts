import {fixed} from '../parts/text';
import type {Bounds} from './points';
import type {ShownScale} from './scale';
import {roundStep, ticksOf} from './span';

/** The axis of values of a chart. */
export interface ValueAxis extends Bounds {
  /** The shown unit, its factor from the measured value, and digits. */
  readonly scale: ShownScale;
  /** By the measured value. */
  readonly ticks: readonly {readonly value: number; readonly text: string}[];
  readonly isLogarithmic: boolean;
}

/** With a margin; at least `spanMin` shows, so that noise does not fill the chart. */
export function withMargin(bounds: Bounds | null, spanMin: number): Bounds {
  const {low, high} = bounds ?? {low: 0, high: 0};
  const span = Math.max(high - low, spanMin, low === 0 ? 0 : 1e-9) || 1;
  const margin = 0.08 * span + (span - (high - low)) / 2;
  return {low: low - margin, high: high + margin};
}

/** Round values of what is shown have ticks, at most so many. */
export function linearAxis({low, high}: Bounds, scale: ShownScale, countMax: number): ValueAxis {
  const {factor} = scale;
  const step = roundStep(((high - low) * factor) / Math.max(countMax, 1));
  const digits = Math.min(9, Math.max(0, Math.ceil(-Math.log10(step) - 1e-9)));
  const ticks = ticksOf({fromS: low * factor, toS: high * factor}, step).map((shown) => ({
    value: shown / factor,
    text: fixed(shown, digits),
  }));
  // The values beside the axis tell at least its ticks apart.
  const all = {...scale, digits: Math.max(scale.digits, digits)};
  return {low, high, scale: all, ticks, isLogarithmic: false};
}

/** An axis of microseconds has ticks at powers of ten. */
export function decadeAxis(bounds: Bounds | null, scale: ShownScale): ValueAxis {
  const low = 0.7 * Math.min(10, Math.max(bounds?.low ?? 10, 0.1));
  const high = 1.4 * Math.max(2000, bounds?.high ?? 0);
  const ticks = [];
  for (let us = 10 ** Math.ceil(Math.log10(low)); us <= high; us *= 10) {
    const text = us < 1e3 ? `${us} µs` : us < 1e6 ? `${us / 1e3} ms` : `${us / 1e6} s`;
    ticks.push({value: us, text});
  }
  // Each tick has a unit of its own.
  return {low, high, scale: {...scale, unit: ''}, ticks, isLogarithmic: true};
}

/** Where a value is on the axis: 0 at its low end, 1 at its high end. */
export function shareOfValue({low, high, isLogarithmic}: ValueAxis, value: number): number {
  return isLogarithmic
    ? Math.log(Math.max(value, low) / low) / Math.log(high / low)
    : (value - low) / (high - low);
}

export function numberText(value: number, {factor, digits}: ShownScale): string {
  return fixed(value * factor, digits);
}

/** "1.20 mm", or "1.20 … 1.35 mm" where a moment has several values; a dash where it has none. */
export function boundsText(bounds: Bounds | null, scale: ShownScale): string {
  if (bounds === null || !Number.isFinite(bounds.low)) return '–';
  const [low, high] = [numberText(bounds.low, scale), numberText(bounds.high, scale)];
  return `${low === high ? low : `${low} … ${high}`} ${scale.unit}`.trim();
}

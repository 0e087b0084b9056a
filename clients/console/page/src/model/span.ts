import {mark} from '../store/settings';

/** Parts of a time axis in seconds, and how they are zoomed, moved and labelled. */

export interface Span {
  readonly fromS: number;
  readonly toS: number;
}

/** Less does not show more: samples come at most every 0.1 ms. */
export const kLengthMinS = 0.001;

export function lengthOf({fromS, toS}: Span): number {
  return toS - fromS;
}

/** The part of `whole` that is nearest to `span`: of its length, or of the least or the greatest. */
export function within(span: Span, whole: Span): Span {
  const lengthS = Math.min(Math.max(lengthOf(span), kLengthMinS), lengthOf(whole));
  // Around its middle if it was too short.
  const fromS = lengthOf(span) < kLengthMinS ? (span.fromS + span.toS - lengthS) / 2 : span.fromS;
  const begin = Math.min(Math.max(fromS, whole.fromS), whole.toS - lengthS);
  return {fromS: begin, toS: begin + lengthS};
}

/** `factor` below 1 shows less; the moment `atS` stays where it is. */
export function zoomed(span: Span, factor: number, atS: number, whole: Span): Span {
  const lengthS = Math.max(lengthOf(span) * factor, kLengthMinS);
  const share = (atS - span.fromS) / lengthOf(span);
  const fromS = atS - share * lengthS;
  return within({fromS, toS: fromS + lengthS}, whole);
}

/** Moved by a share of what shows: 0.1 goes on by a tenth. */
export function moved(span: Span, share: number, whole: Span): Span {
  const byS = share * lengthOf(span);
  return within({fromS: span.fromS + byS, toS: span.toS + byS}, whole);
}

/** As long as before, around a moment. */
export function centred(span: Span, atS: number, whole: Span): Span {
  const half = lengthOf(span) / 2;
  return within({fromS: atS - half, toS: atS + half}, whole);
}

export function shifted({fromS, toS}: Span, byS: number): Span {
  return {fromS: fromS + byS, toS: toS + byS};
}

export function timeAt(span: Span, share: number): number {
  return span.fromS + share * lengthOf(span);
}

export function shareOf(span: Span, timeS: number): number {
  return (timeS - span.fromS) / lengthOf(span);
}

const kSteps = [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14_400, 43_200];

/** The least of 1, 2 and 5 times a power of ten that is not below. */
export function roundStep(least: number): number {
  const decade = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map((one) => one * decade).find((one) => one >= least * 0.999_999) ?? least;
}

/** The round step of an axis of time that has at most so many labels. */
export function stepFor(lengthS: number, countMax: number): number {
  const least = lengthS / Math.max(countMax, 1);
  if (least > 1) return kSteps.find((one) => one >= least) ?? 86_400 * Math.ceil(least / 86_400);
  return roundStep(least);
}

/** The multiples of a step that have labels. */
export function ticksOf(span: Span, stepS: number): number[] {
  const first = Math.ceil(span.fromS / stepS - 1e-9);
  const last = Math.floor(span.toS / stepS + 1e-9);
  return Array.from({length: Math.max(0, last - first + 1)}, (_, i) => (first + i) * stepS);
}

/** The digits of seconds that tell moments apart which are `stepS` from each other. */
export function digitsFor(stepS: number): number {
  return Math.min(6, Math.max(0, Math.ceil(-Math.log10(stepS) - 1e-9)));
}

/** 3661.5 as "1:01:01.5", −0.5 as "−0:00.5". */
export function momentText(seconds: number, digits: number): string {
  const units = Math.round(Math.abs(seconds) * 10 ** digits);
  const sign = seconds < 0 && units > 0 ? '−' : '';
  const whole = Math.floor(units / 10 ** digits);
  const rest = (units / 10 ** digits - whole).toFixed(digits).slice(1);
  const hours = Math.floor(whole / 3600);
  const minutes = Math.floor(whole / 60) % 60;
  const two = (count: number) => String(count).padStart(2, '0');
  const clock = hours > 0 ? `${hours}:${two(minutes)}` : String(minutes);
  const point = mark.value === 'comma' ? ',' : '.';
  return `${sign}${clock}:${two(whole % 60)}${rest.replace('.', point)}`;
}

/** The time of day where the browser is, with so many digits of seconds, or none at all. */
export function clockText(seconds: number, digits: number, hasSeconds: boolean): string {
  const date = new Date(1000 * seconds);
  const two = (value: number) => String(value).padStart(2, '0');
  const minute = `${two(date.getHours())}:${two(date.getMinutes())}`;
  if (!hasSeconds) return minute;
  const point = mark.value === 'comma' ? ',' : '.';
  const fraction = String(date.getMilliseconds()).padStart(3, '0').slice(0, digits);
  return `${minute}:${two(date.getSeconds())}${fraction === '' ? '' : point + fraction}`;
}

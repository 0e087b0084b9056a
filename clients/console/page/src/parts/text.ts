import {mark} from '../store/settings';
import {language, texts} from '../texts/texts';

/** Numbers and times as people read them, and as they type them. */

const kThinSpace = '\u202f';

function marked(text: string): string {
  return mark.value === 'comma' ? text.replace('.', ',') : text;
}

/** Thousands apart, from five digits on: 1234.5, but 12 345.6. */
function grouped(text: string): string {
  const [whole = '', ...rest] = text.split('.');
  const apart = whole.length > 4 ? whole.replace(/\B(?=(\d{3})+$)/g, kThinSpace) : whole;
  return marked([apart, ...rest].join('.'));
}

export function fixed(value: number | null | undefined, digits: number): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return '–';
  const text = grouped(Math.abs(value).toFixed(digits));
  return value < 0 && /[1-9]/.test(text) ? `−${text}` : text;
}

/** A number with no more digits than it has, as a field shows it and `parsed` reads it. */
export function plain(value: number | bigint): string {
  if (typeof value === 'bigint') return value.toString();
  if (!Number.isFinite(value)) {
    return value > 0 ? '∞' : value < 0 ? '−∞' : texts.value.numbers.notOne;
  }
  const size = Math.abs(value);
  const text =
    size !== 0 && (size < 1e-4 || size >= 1e7)
      ? value.toExponential().replace('e+', 'e')
      : String(Number(value.toPrecision(12)));
  return marked(text);
}

/** Between the elements of a vector, so that it is no decimal mark. */
export function separator(): string {
  return mark.value === 'comma' ? '; ' : ', ';
}

const kReal = /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i;
const kSpaces = /[\u202f\u2009\u00a0]/g;
/** With the mark that is not the chosen one: 1,500 may be one and a half, or 1500. */
const kDoubtful = /^[+-]?[1-9]\d{0,2}[.,]\d{3}$/;

/** Reads a number with a point or a comma; null: there is none, or it may mean two things. */
export function parsed(typed: string): number | null {
  const text = typed.trim().replace('−', '-').replaceAll(kSpaces, '');
  const other = mark.value === 'comma' ? '.' : ',';
  if (text.includes(other) && kDoubtful.test(text)) return null;
  const real = text.replace(',', '.');
  return kReal.test(real) ? Number(real) : null;
}

export function duration(seconds: number): string {
  if (seconds < 1e-3) return `${fixed(seconds * 1e6, 0)} µs`;
  if (seconds < 1) return `${plain(Number((seconds * 1e3).toPrecision(3)))} ms`;
  if (seconds < 60) return `${fixed(seconds, seconds < 10 ? 1 : 0)} s`;
  const minutes = Math.floor(seconds / 60);
  if (minutes < 60) return `${minutes} min ${Math.floor(seconds % 60)} s`;
  const hours = Math.floor(minutes / 60);
  return hours < 48
    ? `${hours} h ${minutes % 60} min`
    : texts.value.numbers.days(Math.floor(hours / 24));
}

function locale(): string {
  return language.value === 'de' ? 'de-DE' : 'en-GB';
}

export function timeOfDay(ms: number): string {
  return new Date(ms).toLocaleTimeString(locale());
}

export function dayAndTime(ms: number): string {
  const day = new Date(ms).toLocaleDateString(locale(), {day: '2-digit', month: 'short'});
  return `${day}, ${timeOfDay(ms)}`;
}

export function bytes(count: number): string {
  if (count < 1e3) return `${count} B`;
  if (count < 1e6) return `${fixed(count / 1e3, 1)} kB`;
  return count < 1e9 ? `${fixed(count / 1e6, 1)} MB` : `${fixed(count / 1e9, 2)} GB`;
}

export function micros(us: number | null): string {
  if (us === null) return '–';
  if (us >= 1e6) return `${fixed(us / 1e6, 2)} s`;
  if (us >= 1e5) return `${fixed(us / 1000, 0)} ms`;
  if (us >= 1e4) return `${fixed(us / 1000, 1)} ms`;
  return us >= 1000 ? `${fixed(us / 1000, 2)} ms` : `${fixed(us, us < 10 ? 1 : 0)} µs`;
}

export function thousands(count: number): string {
  return Math.round(count)
    .toString()
    .replace(/\B(?=(\d{3})+$)/g, kThinSpace);
}

export function rate(perSecond: number): string {
  return `${perSecond > 0 && perSecond < 10 ? fixed(perSecond, 1) : thousands(perSecond)}/s`;
}

export function percent(share: number | null, digits = 0): string {
  return share === null ? '–' : `${fixed(100 * share, digits)} %`;
}

/** Numbers and times as people read them. */

export function fixed(value: number | null | undefined, digits: number): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return '–';
  const text = value.toFixed(digits);
  return /^-0(\.0*)?$/.test(text) ? text.slice(1) : text.replace('-', '−');
}

export function duration(seconds: number): string {
  if (seconds < 1) return `${Math.round(seconds * 1000)} ms`;
  if (seconds < 60) return `${seconds.toFixed(1)} s`;
  const minutes = Math.floor(seconds / 60);
  if (minutes < 60) return `${minutes} min ${Math.floor(seconds % 60)} s`;
  const hours = Math.floor(minutes / 60);
  return hours < 48 ? `${hours} h ${minutes % 60} min` : `${Math.floor(hours / 24)} days`;
}

/** 61.5 as "1:01.5". */
export function clock(seconds: number, digits = 0): string {
  const whole = Math.max(0, seconds);
  const minutes = Math.floor(whole / 60);
  const rest = (whole % 60).toFixed(digits).padStart(digits === 0 ? 2 : 3 + digits, '0');
  return `${minutes}:${rest}`;
}

export function timeOfDay(ms: number): string {
  return new Date(ms).toLocaleTimeString('en-GB');
}

export function dayAndTime(ms: number): string {
  const day = new Date(ms).toLocaleDateString('en-GB', {day: '2-digit', month: 'short'});
  return `${day}, ${timeOfDay(ms)}`;
}

export function bytes(count: number): string {
  if (count < 1e3) return `${count} B`;
  if (count < 1e6) return `${(count / 1e3).toFixed(1)} kB`;
  return count < 1e9 ? `${(count / 1e6).toFixed(1)} MB` : `${(count / 1e9).toFixed(2)} GB`;
}

export function micros(us: number | null): string {
  if (us === null) return '–';
  if (us >= 1e6) return `${(us / 1e6).toFixed(2)} s`;
  if (us >= 1e5) return `${(us / 1000).toFixed(0)} ms`;
  if (us >= 1e4) return `${(us / 1000).toFixed(1)} ms`;
  return us >= 1000 ? `${(us / 1000).toFixed(2)} ms` : `${us.toFixed(us < 10 ? 1 : 0)} µs`;
}

export function thousands(count: number): string {
  return Math.round(count)
    .toString()
    .replace(/\B(?=(\d{3})+$)/g, '\u202f');
}

export function rate(perSecond: number): string {
  return `${perSecond < 10 ? fixed(perSecond, 1) : thousands(perSecond)}/s`;
}

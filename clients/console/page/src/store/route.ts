import {signal, type Signal} from '@preact/signals';

/** Which view shows, and of which device: `#/live/lab/arm0`. */

export const kViews = [
  'overview',
  'live',
  'plots',
  'parameters',
  'recordings',
  'incidents',
  'events',
] as const;
export type View = (typeof kViews)[number];

export interface Route {
  readonly view: View;
  /** Empty: none is chosen. */
  readonly subject: string;
}

export function readRoute(hash: string): Route {
  const [view, ...rest] = hash.replace(/^#?\/?/, '').split('/');
  const known = kViews.find((one) => one === view);
  return {
    view: known ?? 'overview',
    subject: known === undefined ? '' : rest.map(decoded).join('/'),
  };
}

/** An address from elsewhere may have a sign that begins no code. */
function decoded(part: string): string {
  try {
    return decodeURIComponent(part);
  } catch {
    return part;
  }
}

export function writeRoute(view: View, subject = ''): string {
  const path = subject === '' ? '' : `/${subject.split('/').map(encodeURIComponent).join('/')}`;
  return `#/${view}${path}`;
}

export function routeSignal(): Signal<Route> {
  const route = signal(readRoute(window.location.hash));
  window.addEventListener('hashchange', () => (route.value = readRoute(window.location.hash)));
  return route;
}

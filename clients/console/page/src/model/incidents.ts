import {number, object, objects, text} from '../protocol/fields';
import type {Json} from '../protocol/json';
import {finder} from './words';

export const kSeverities = ['info', 'warning', 'alarm'] as const;
export type Severity = (typeof kSeverities)[number];

/** An incident. Times are in nanoseconds since 1970. */
export interface Incident {
  readonly id: number;
  readonly who: string;
  readonly what: string;
  readonly why: string;
  readonly severity: Severity;
  readonly sinceNs: number;
  /** Null: it lasts. */
  readonly untilNs: number | null;
  readonly count: number;
  /** The recording that ran; empty: none. */
  readonly recording: string;
  readonly acknowledgedBy: string;
  readonly acknowledgedNs: number | null;
}

export interface IncidentList {
  readonly incidents: readonly Incident[];
  /** All that the console has. */
  readonly count: number;
  readonly droppedCount: number;
}

function timeOrNull(value: Json | undefined): number | null {
  const ns = number(value);
  return ns === 0 ? null : ns;
}

export function readIncidents(value: Json): IncidentList {
  const all = object(value);
  return {
    incidents: objects(all['incidents']).map((one) => ({
      id: number(one['id']),
      who: text(one['who']),
      what: text(one['what']),
      why: text(one['why']),
      severity: kSeverities.find((each) => each === one['severity']) ?? 'warning',
      sinceNs: number(one['since_ns']),
      untilNs: timeOrNull(one['until_ns']),
      count: number(one['count'], 1),
      recording: text(one['recording']),
      acknowledgedBy: text(one['acknowledged_by']),
      acknowledgedNs: timeOrNull(one['acknowledged_ns']),
    })),
    count: number(all['count']),
    droppedCount: number(all['dropped_count']),
  };
}

export const kShows = ['unseen', 'open', 'all'] as const;
export type Show = (typeof kShows)[number];

/** The incidents that an operator asks for. */
export function chosen(incidents: readonly Incident[], show: Show, search: string): Incident[] {
  const isFound = finder(search);
  return incidents.filter((one) => {
    if (show === 'open' && one.untilNs !== null) return false;
    if (show === 'unseen' && !isUnseen(one) && one.untilNs !== null) return false;
    return isFound(`${one.who} ${one.what} ${one.why} ${one.acknowledgedBy} ${one.recording}`);
  });
}

/** Whether it asks for an acknowledgement. */
export function isUnseen(one: Incident): boolean {
  return one.acknowledgedNs === null && one.severity !== 'info';
}

/** A cell of a CSV file; what a spreadsheet would take for a formula is text. */
function cell(value: string | number): string {
  const words = String(value);
  const safe = /^[=+\-@\t\r]/.test(words) && typeof value === 'string' ? `'${words}` : words;
  return /[",\n\r]/.test(safe) ? `"${safe.replaceAll('"', '""')}"` : safe;
}

function iso(ns: number | null): string {
  return ns === null ? '' : new Date(ns / 1e6).toISOString();
}

/** As `rtpm incidents --csv` prints them. */
export function toCsv(incidents: readonly Incident[]): string {
  const rows: (string | number)[][] = incidents.map((one) => [
    one.id,
    one.severity,
    one.who,
    one.what,
    one.why,
    iso(one.sinceNs),
    iso(one.untilNs),
    one.untilNs === null ? '' : ((one.untilNs - one.sinceNs) / 1e9).toFixed(3),
    one.count,
    one.acknowledgedBy,
    iso(one.acknowledgedNs),
    one.recording,
  ]);
  const head = [
    'id',
    'severity',
    'who',
    'what',
    'why',
    'since',
    'until',
    'seconds',
    'count',
    'acknowledged by',
    'acknowledged',
    'recording',
  ];
  return [head, ...rows].map((row) => `${row.map(cell).join(',')}\r\n`).join('');
}

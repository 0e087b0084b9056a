import {number, object, objects, text} from '../protocol/fields';
import type {Json, JsonObject} from '../protocol/json';
import type {Link} from './link';

/** Far above the cycles of a record. */
const kPageMax = 1000;

export interface FlightRecord {
  /** Counts the device's faults. */
  readonly number: number;
  readonly cause: string;
  readonly csv: string;
}

function flattened(value: Json, name: string, row: Map<string, string>): void {
  if (typeof value === 'object' && value !== null) {
    const entries = Array.isArray(value) ? [...value.entries()] : Object.entries(value);
    for (const [key, part] of entries) flattened(part as Json, `${name}.${key}`, row);
  } else {
    row.set(name, String(value));
  }
}

function csvOf(cycles: readonly JsonObject[]): string {
  const rows = cycles.map((cycle) => {
    const row = new Map<string, string>();
    for (const [key, value] of Object.entries(cycle)) flattened(value, key, row);
    return row;
  });
  const columns = [...new Set(rows.flatMap((row) => [...row.keys()]))];
  const lines = [columns, ...rows.map((row) => columns.map((one) => row.get(one) ?? ''))];
  return lines.map((line) => `${line.join(',')}\r\n`).join('');
}

/** The cycles around a device's newest fault; null: there was none. Rejects with CallError. */
export async function readFlightRecord(link: Link, device: string): Promise<FlightRecord | null> {
  const cycles: JsonObject[] = [];
  for (let page = 0; page < kPageMax; ++page) {
    const reply = object(await link.call(`${device}/read_flight_record`, {first: cycles.length}));
    const part = objects(reply['cycles']);
    cycles.push(...part);
    if (number(reply['number']) === 0) return null;
    if (part.length === 0 || cycles.length >= number(reply['cycle_count'])) {
      return {number: number(reply['number']), cause: text(reply['cause']), csv: csvOf(cycles)};
    }
  }
  return null;
}

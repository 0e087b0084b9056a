import {number, numberOrNull, object, objects, text} from '../protocol/fields';
import type {Json} from '../protocol/json';

/** How long the console's own reads of each device took: `console/latency`. */

export interface Bin {
  readonly fromUs: number;
  readonly toUs: number;
  readonly count: number;
}

export interface Target {
  readonly name: string;
  readonly p50Us: number | null;
  readonly p90Us: number | null;
  readonly p99Us: number | null;
  readonly p999Us: number | null;
  readonly maxUs: number | null;
  readonly count: number;
  readonly failedCount: number;
  readonly bins: readonly Bin[];
}

export interface Latency {
  readonly targets: readonly Target[];
}

export function readLatency(value: Json): Latency {
  const latency = object(value);
  return {
    targets: objects(latency['targets']).map((target) => ({
      name: text(target['name']),
      p50Us: numberOrNull(target['p50_us']),
      p90Us: numberOrNull(target['p90_us']),
      p99Us: numberOrNull(target['p99_us']),
      p999Us: numberOrNull(target['p999_us']),
      maxUs: numberOrNull(target['max_us']),
      count: number(target['count']),
      failedCount: number(target['failed_count']),
      bins: objects(target['histogram']).map((bin) => ({
        fromUs: number(bin['from_us']),
        toUs: number(bin['to_us']),
        count: number(bin['count']),
      })),
    })),
  };
}

/** The share of calls that took at most `boundUs`; of a bin across it, the part below it. */
export function shareWithin(bins: readonly Bin[], boundUs: number): number | null {
  let total = 0;
  let within = 0;
  for (const {fromUs, toUs, count} of bins) {
    total += count;
    if (toUs <= boundUs) within += count;
    else if (fromUs < boundUs) within += (count * (boundUs - fromUs)) / (toUs - fromUs);
  }
  return total === 0 ? null : within / total;
}

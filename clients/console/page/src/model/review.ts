import {flag, list, number, numberOrNull, numbers, object, objects, text} from '../protocol/fields';
import type {Json, JsonObject} from '../protocol/json';
import {pointsOf, type Points} from './points';
import {finder} from './words';

/** A recording under review. All times are in seconds since its beginning. */

export interface ReviewField {
  /** "lab/arm0/sampled.position_m.x" */
  readonly path: string;
  readonly unit: string;
}

export type HappeningKind = 'marker' | 'trial' | 'note' | 'fault' | 'stop' | 'lost' | 'lease';

/** A marker, a trial, a note, or an incident of a device. */
export interface Happening {
  readonly kind: HappeningKind;
  readonly atS: number;
  /** null: it has no length, or its end is not recorded. */
  readonly endS: number | null;
  readonly text: string;
  /** An incident's; else empty. */
  readonly device: string;
  /** A trial's, from 1. */
  readonly number: number;
  /** When a note was made, as the console told it. */
  readonly madeNs: number | bigint;
  readonly timeNs: number | bigint;
}

export interface Run {
  readonly file: string;
  readonly beginNs: bigint;
  readonly lengthS: number;
  readonly messageCount: number;
  readonly isComplete: boolean;
  /** Why not all of it was read; empty: nothing is wrong. */
  readonly problem: string;
  /** The overview's: 0 to 1. */
  readonly progress: number;
  readonly session: readonly (readonly [string, string])[];
  readonly fields: readonly ReviewField[];
  readonly omittedFieldCount: number;
  readonly unreadableTopics: readonly string[];
  /** By time, without notes; so many as the console keeps. */
  readonly happenings: readonly Happening[];
  /** How many there are, by what. */
  readonly counts: {
    readonly markers: number;
    readonly trials: number;
    readonly incidents: number;
  };
  readonly notes: readonly Happening[];
  readonly notesProblem: string;
  /** The part that is being cut out of it. */
  readonly cut: {readonly file: string; readonly progress: number} | null;
}

export interface Curves {
  readonly byField: ReadonlyMap<string, Points>;
  /** Read from the file, and not a part of the overview. */
  readonly isExact: boolean;
  readonly problem: string;
  /** Those of the window, where it was read. */
  readonly happenings: readonly Happening[];
}

export function nsOf(value: Json | undefined): bigint {
  if (typeof value === 'bigint') return value;
  return typeof value === 'number' && Number.isFinite(value) ? BigInt(Math.round(value)) : 0n;
}

/** Exact to a microsecond in runs of years. */
export function secondsSince(beginNs: bigint, timeNs: bigint): number {
  return Number(timeNs - beginNs) / 1e9;
}

export function timeNsAt(beginNs: bigint, seconds: number): bigint {
  const timeNs = beginNs + BigInt(Math.round(seconds * 1e9));
  return timeNs < 0n ? 0n : timeNs;
}

export function readRun(file: string, reply: Json): Run {
  const json = object(reply);
  const beginNs = nsOf(json['begin_ns']);
  const endNs = nsOf(json['end_ns']);
  const cut = object(json['cut']);
  return {
    file,
    beginNs,
    lengthS: Math.max(secondsSince(beginNs, endNs), 0),
    messageCount: number(json['message_count']),
    isComplete: flag(json['is_complete']),
    problem: text(json['problem']),
    progress: number(json['progress']),
    session: Object.entries(object(json['session'])).map(([name, value]) => [name, text(value)]),
    fields: objects(json['fields']).map((one) => ({
      path: text(one['path']),
      unit: text(one['unit']),
    })),
    omittedFieldCount: number(json['omitted_field_count']),
    unreadableTopics: list(json['unreadable_topics']).map((one) => text(one)),
    happenings: readHappenings(beginNs, json),
    counts: {
      markers: number(json['marker_count']),
      trials: number(json['trial_count']),
      incidents: number(json['incident_count']),
    },
    notes: readNotes(beginNs, json['notes']),
    notesProblem: text(json['notes_problem']),
    cut:
      text(cut['file']) === ''
        ? null
        : {file: text(cut['file']), progress: number(cut['progress'])},
  };
}

const kNothing = {endS: null, device: '', number: 0, madeNs: 0};

export function readNotes(beginNs: bigint, notes: Json | undefined): Happening[] {
  return objects(notes).map((one) => ({
    ...kNothing,
    kind: 'note',
    atS: secondsSince(beginNs, nsOf(one['time_ns'])),
    text: text(one['text']),
    madeNs: nsOf(one['made_ns']),
    timeNs: nsOf(one['time_ns']),
  }));
}

function readHappenings(beginNs: bigint, json: JsonObject): Happening[] {
  const at = (value: Json | undefined) => secondsSince(beginNs, nsOf(value));
  const endOf = (one: JsonObject) =>
    numberOrNull(one['end_ns']) === null ? null : at(one['end_ns']);
  const markers = objects(json['markers']).map((one): Happening => ({
    ...kNothing,
    kind: 'marker',
    atS: at(one['time_ns']),
    text: text(one['label']),
    timeNs: nsOf(one['time_ns']),
  }));
  const trials = objects(json['trials']).map((one): Happening => ({
    ...kNothing,
    kind: 'trial',
    atS: at(one['begin_ns']),
    endS: endOf(one),
    text: [text(one['condition']), text(one['response'])].filter((part) => part).join(' → '),
    number: number(one['number']),
    timeNs: nsOf(one['begin_ns']),
  }));
  const kKinds = ['fault', 'stop', 'lost', 'lease'] as const;
  const incidents = objects(json['incidents']).map((one): Happening => ({
    ...kNothing,
    kind: kKinds.find((kind) => kind === text(one['kind'])) ?? 'fault',
    atS: at(one['begin_ns']),
    endS: endOf(one),
    text: text(one['what']),
    device: text(one['device']),
    timeNs: nsOf(one['begin_ns']),
  }));
  return [...markers, ...trials, ...incidents].sort((a, b) => a.atS - b.atS);
}

export function readCurves(beginNs: bigint, reply: Json): Curves {
  const json = object(reply);
  const beginS = secondsSince(beginNs, nsOf(json['begin_ns']));
  const stepS = number(json['bucket_ns'], 1) / 1e9;
  const byField = new Map<string, Points>();
  for (const one of objects(json['series'])) {
    const read = (name: string) => list(one[name]).map(numberOrNull);
    const values = read('values');
    const low = read('low');
    const points =
      one['values'] === undefined
        ? pointsOf(
            low.map((_, i) => beginS + i * stepS),
            low,
            read('high'),
            stepS,
          )
        : pointsOf(
            numbers(one['offset_ns']).map((ns) => beginS + ns / 1e9),
            values,
            values,
            0,
          );
    byField.set(text(one['field']), points);
  }
  return {
    byField,
    isExact: flag(json['is_exact']),
    problem: text(json['problem']),
    happenings: readHappenings(beginNs, json),
  };
}

/** Fields that one axis shows: those of one unit, in their order. */
export function byUnit(fields: readonly ReviewField[]): readonly (readonly ReviewField[])[] {
  const groups = new Map<string, ReviewField[]>();
  for (const field of fields) {
    const group = groups.get(field.unit) ?? [];
    group.push(field);
    groups.set(field.unit, group);
  }
  return [...groups.values()];
}

/** The fields that are shown first: where something is, and what pushes it. */
export function firstFields(fields: readonly ReviewField[]): readonly string[] {
  const paths = fields.map((one) => one.path);
  const sampled = paths.find((path) => path.includes('/sampled.'));
  const topic = sampled?.slice(0, sampled.indexOf('/sampled.') + '/sampled.'.length) ?? '';
  const wanted = ['position_m.x', 'position_m.y', 'position_m.z']
    .concat(['force_newton.x', 'force_newton.y', 'force_newton.z'])
    .map((name) => `${topic}${name}`)
    .filter((path) => paths.includes(path));
  return wanted.length > 0 ? wanted : paths.slice(0, 3);
}

/** Fields whose path has all the words, in any order; at most `countMax`. */
export function search(
  fields: readonly ReviewField[],
  words: string,
  countMax: number,
): readonly ReviewField[] {
  const isFound = finder(words);
  return fields.filter(({path}) => isFound(path)).slice(0, countMax);
}

/** "position_m.x" of "lab/arm0/sampled.position_m.x"; the device is told apart from it. */
export function shortName(path: string): {readonly topic: string; readonly name: string} {
  const slash = path.lastIndexOf('/');
  const dot = path.indexOf('.', slash);
  return dot < 0 ? {topic: '', name: path} : {topic: path.slice(0, dot), name: path.slice(dot + 1)};
}

/** At most `countMax`, in their order: people's marks before incidents. */
export function mostTelling(
  happenings: readonly Happening[],
  countMax: number,
): readonly Happening[] {
  const isOfPeople = ({kind}: Happening) => ['marker', 'trial', 'note'].includes(kind);
  const ofPeople = happenings.filter(isOfPeople).slice(0, countMax);
  const others = happenings.filter((one) => !isOfPeople(one)).slice(0, countMax - ofPeople.length);
  const chosen = new Set([...ofPeople, ...others]);
  return happenings.filter((one) => chosen.has(one));
}

/** Where another recording has the moment by which both are aligned; null: it has none. */
export function originOf(run: Run, label: string): number | null {
  if (label === '') return 0;
  return run.happenings.find((one) => one.kind === 'marker' && one.text === label)?.atS ?? null;
}

/** The labels of markers that both recordings have, at most `countMax`. */
export function commonLabels(a: Run, b: Run, countMax = 50): readonly string[] {
  const labels = (run: Run) =>
    run.happenings.filter((one) => one.kind === 'marker' && one.text !== '').map((one) => one.text);
  const known = new Set(labels(b));
  return [...new Set(labels(a))].filter((label) => known.has(label)).slice(0, countMax);
}

/** "run-1.mcap" becomes "run-1-cut.mcap", or "run-1-cut2.mcap" if there is one. */
export function cutName(file: string, taken: ReadonlySet<string>): string {
  const stem = file.replace(/\.mcap$/, '');
  for (let i = 1; ; ++i) {
    const name = `${stem}-cut${i === 1 ? '' : i}.mcap`;
    if (!taken.has(name)) return name;
  }
}

/** The name of a file, as people type it. */
export function withEnding(name: string): string {
  const trimmed = name.trim();
  return trimmed.endsWith('.mcap') || trimmed === '' ? trimmed : `${trimmed}.mcap`;
}

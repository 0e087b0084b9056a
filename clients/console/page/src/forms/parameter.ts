import {flag, list, number, object, text, texts, whole} from '../protocol/fields';
import type {Json, JsonObject} from '../protocol/json';

/** A parameter as `NAME/config/list` describes it (schema/idl/configuration.fbs). */

export type ParameterType = 'Bool' | 'Integer' | 'Real' | 'Text' | 'Choice' | 'Vector';
export type Mutability = 'AnyTime' | 'Inactive' | 'ReadOnly';
export type Value = boolean | number | bigint | string | readonly number[];

export interface Parameter {
  readonly name: string;
  readonly type: ParameterType;
  /** How the server itself calls the type of the value: that of a Choice is Text. */
  readonly valueType: string;
  readonly unit: string;
  readonly low: number;
  readonly high: number;
  readonly choices: readonly string[];
  readonly vectorSize: number;
  readonly defaultValue: Value;
  readonly value: Value;
  readonly description: string;
  readonly mutability: Mutability;
}

export interface ParameterList {
  readonly model: string;
  readonly serial: string;
  readonly revision: number | bigint;
  readonly isActive: boolean;
  readonly isPersistent: boolean;
  readonly isUnsaved: boolean;
  readonly parameters: readonly Parameter[];
}

/** The outcome of a request, in words. */
export interface Answer {
  readonly outcome: string;
  readonly parameter: string;
  readonly what: string;
  readonly why: string;
  readonly remedy: string;
}

const kTypes: readonly ParameterType[] = ['Bool', 'Integer', 'Real', 'Text', 'Choice', 'Vector'];
const kMutabilities: readonly Mutability[] = ['AnyTime', 'Inactive', 'ReadOnly'];

/** No quantity is as large. */
const kUnlimited = 1e300;

/** An enum comes by its name or its number; absent it is the first. */
function pick<T extends string>(names: readonly T[], value: Json | undefined): T {
  const byName = names.find((name) => name === value);
  return byName ?? names[number(value)] ?? (names[0] as T);
}

function real(value: Json | undefined): number {
  return typeof value === 'number' ? value : number(value);
}

/** A bound: what is beyond all numbers may come as null, as JSON has no word for it. */
function bound(value: Json | undefined, unlimited: number): number {
  const limit = value === null ? unlimited : real(value);
  return Math.abs(limit) > kUnlimited ? unlimited : limit;
}

export function readValue(type: ParameterType, value: Json | undefined): Value {
  const fields = object(value);
  switch (type) {
    case 'Bool':
      return flag(fields['flag']);
    case 'Integer':
      return whole(fields['integer']);
    case 'Real':
      return real(fields['real']);
    case 'Vector':
      return list(fields['elements']).map(real);
    default:
      return text(fields['text']);
  }
}

function readParameter(fields: JsonObject): Parameter {
  const type = pick(kTypes, fields['type']);
  return {
    name: text(fields['name']),
    type,
    valueType: pick(kTypes, object(fields['value'])['type']),
    unit: text(fields['unit']),
    low: bound(fields['low'], -Infinity),
    high: bound(fields['high'], Infinity),
    choices: texts(fields['choices']),
    vectorSize: number(fields['vector_size']),
    defaultValue: readValue(type, fields['default_value']),
    value: readValue(type, fields['value']),
    description: text(fields['description']),
    mutability: pick(kMutabilities, fields['mutability']),
  };
}

export function readParameterList(reply: Json): ParameterList {
  const fields = object(reply);
  return {
    model: text(fields['model']),
    serial: text(fields['serial']),
    revision: whole(fields['revision']),
    isActive: flag(fields['is_active']),
    isPersistent: flag(fields['is_persistent']),
    isUnsaved: flag(fields['is_unsaved']),
    parameters: list(fields['parameters']).map((one) => readParameter(object(one))),
  };
}

const kOutcomes = [
  'Done',
  'UnknownParameter',
  'WrongType',
  'OutOfRange',
  'ReadOnly',
  'WrongState',
  'RepeatedParameter',
  'StaleRevision',
  'Busy',
  'RefusedByDevice',
  'NotPersistent',
  'StorageFailed',
  'UnknownCalibration',
  'NoSuchRun',
  'WrongAnswer',
  'NoResult',
] as const;

export function readAnswer(reply: Json): Answer {
  const answer = object(object(reply)['answer']);
  return {
    outcome: pick(kOutcomes, answer['outcome']),
    parameter: text(answer['parameter']),
    what: text(answer['what']),
    why: text(answer['why']),
    remedy: text(answer['remedy']),
  };
}

/** The answer as a sentence for people. */
export function wordsOf(answer: Answer): string {
  const reason = [answer.what, answer.why].filter((part) => part !== '').join(': ');
  const sentence = reason === '' ? `refused (${answer.outcome})` : reason;
  return answer.remedy === '' ? sentence : `${sentence}. ${capital(answer.remedy)}`;
}

function capital(words: string): string {
  return words.charAt(0).toUpperCase() + words.slice(1);
}

/** A setting, as apply takes it. */
export function writeSetting(parameter: Parameter, value: Value): JsonObject {
  const fields: Record<string, Json> = {type: parameter.valueType};
  if (typeof value === 'boolean') fields['flag'] = value;
  else if (typeof value === 'string') fields['text'] = value;
  else if (typeof value === 'object') fields['elements'] = value;
  else if (parameter.type === 'Integer') fields['integer'] = value;
  else fields['real'] = value;
  return {name: parameter.name, value: fields};
}

export function isSame(a: Value, b: Value): boolean {
  if (typeof a !== 'object' || typeof b !== 'object') return a === b;
  return a.length === b.length && a.every((one, i) => one === b[i]);
}

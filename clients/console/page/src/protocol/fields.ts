import type {Json, JsonObject} from './json';

/** Reads fields of JSON from outside: what is absent or of another type is the stated default. */

const kNothing: JsonObject = {};

export function object(value: Json | undefined): JsonObject {
  return value !== null && typeof value === 'object' && !Array.isArray(value)
    ? (value as JsonObject)
    : kNothing;
}

export function list(value: Json | undefined): readonly Json[] {
  return Array.isArray(value) ? (value as readonly Json[]) : [];
}

export function objects(value: Json | undefined): JsonObject[] {
  return list(value).map(object);
}

export function text(value: Json | undefined, otherwise = ''): string {
  return typeof value === 'string' ? value : otherwise;
}

export function texts(value: Json | undefined): string[] {
  return list(value).filter((one): one is string => typeof one === 'string');
}

export function flag(value: Json | undefined): boolean {
  return value === true;
}

export function numberOrNull(value: Json | undefined): number | null {
  if (typeof value === 'bigint') return Number(value);
  return typeof value === 'number' && Number.isFinite(value) ? value : null;
}

export function number(value: Json | undefined, otherwise = 0): number {
  return numberOrNull(value) ?? otherwise;
}

export function numbers(value: Json | undefined): number[] {
  return list(value).map((one) => number(one));
}

/** A whole number as exact as it came, for sending it back. */
export function whole(value: Json | undefined): number | bigint {
  return typeof value === 'bigint' || typeof value === 'number' ? value : 0;
}

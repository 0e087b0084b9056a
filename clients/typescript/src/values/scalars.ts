import { BadValue } from "./codec.js";

// The checks of numbers that a type cannot hold; DataView would cut them off silently.

/** A value as its program has it: a text in quotation marks. */
const shown = (value: unknown): string =>
  typeof value === "string" ? JSON.stringify(value) : String(value);

function checked(value: number, low: number, high: number): number {
  if (!Number.isInteger(value) || value < low || value > high) {
    throw new BadValue(`${shown(value)} is no integer within ${low} to ${high}`);
  }
  return value;
}

function checkedBig(value: bigint, low: bigint, high: bigint): bigint {
  if (typeof value !== "bigint" || value < low || value > high) {
    throw new BadValue(`${shown(value)} is no bigint within ${low} to ${high}`);
  }
  return value;
}

/** Checks an integer. @throws BadValue unless the type holds it */
export const int8 = (value: number): number => checked(value, -0x80, 0x7f);
export const uint8 = (value: number): number => checked(value, 0, 0xff);
export const int16 = (value: number): number => checked(value, -0x8000, 0x7fff);
export const uint16 = (value: number): number => checked(value, 0, 0xffff);
export const int32 = (value: number): number => checked(value, -0x8000_0000, 0x7fff_ffff);
export const uint32 = (value: number): number => checked(value, 0, 0xffff_ffff);
export const int64 = (value: bigint): bigint => checkedBig(value, -(1n << 63n), (1n << 63n) - 1n);
export const uint64 = (value: bigint): bigint => checkedBig(value, 0n, (1n << 64n) - 1n);

/** Checks a floating point number. @throws BadValue unless it is a number; NaN is one */
export function real(value: number): number {
  if (typeof value !== "number") throw new BadValue(`${shown(value)} is no number`);
  return value;
}

/** Checks an array of a struct. @throws BadValue unless it has so many elements */
export function count(actual: number, expected: number): void {
  if (actual !== expected) {
    throw new BadValue(`an array has ${actual} elements, not ${expected}`);
  }
}

/**
 * Checks a range of a request.
 * @param name the field's place, such as "x"
 * @throws BadValue for a number outside it, or NaN
 */
export function range(
  name: string,
  value: number | bigint,
  low: number,
  high: number,
  limits: string,
): void {
  if (!(value >= low && value <= high)) {
    throw new BadValue(`${name} is ${value}, but must be ${limits}`);
  }
}

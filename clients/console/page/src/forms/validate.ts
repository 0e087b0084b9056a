import {parsed, plain, separator} from '../parts/text';
import {texts} from '../texts/texts';
import type {Parameter, Value} from './parameter';

/** Checks typed values of a form, before anything is sent. */

export type Checked =
  | {readonly isValid: true; readonly value: Value}
  | {readonly isValid: false; readonly problem: string};

const kWhole = /^[+-]?\d+$/;

function wrong(problem: string): Checked {
  return {isValid: false, problem};
}

function unitOf(parameter: Parameter): string {
  return parameter.unit === '' || parameter.unit === '1' ? '' : ` ${parameter.unit}`;
}

/** "0 to 0.5 s", "at least 0 m"; empty where any number will do. */
export function rangeText(parameter: Parameter): string {
  if (!['Integer', 'Real', 'Vector'].includes(parameter.type)) return '';
  const words = texts.value.checks;
  const {low, high} = parameter;
  const unit = unitOf(parameter);
  if (Number.isFinite(low) && Number.isFinite(high)) {
    return `${words.range(plain(low), plain(high))}${unit}`;
  }
  if (Number.isFinite(low)) return `${words.atLeast(plain(low))}${unit}`;
  return Number.isFinite(high) ? `${words.atMost(plain(high))}${unit}` : '';
}

/** A value as a field shows it, and as `check` reads it back. */
export function valueText(value: Value): string {
  if (typeof value === 'object') return value.map(plain).join(separator());
  if (typeof value === 'number' || typeof value === 'bigint') return plain(value);
  return String(value);
}

function checkRange(parameter: Parameter, value: number): string | null {
  if (value >= parameter.low && value <= parameter.high) return null;
  const words = texts.value.checks;
  const say = value < parameter.low ? words.below : words.above;
  return say(plain(value), rangeText(parameter));
}

function checkReal(parameter: Parameter, draft: string): Checked {
  const words = texts.value.checks;
  const typed = draft.trim();
  if (typed === '') return wrong(words.typeNumber);
  const value = parsed(typed);
  if (value === null) return wrong(words.noNumber(typed, plain(0.25), plain(1500)));
  if (!Number.isFinite(value)) return wrong(words.tooLarge(typed));
  const problem = checkRange(parameter, value);
  return problem === null ? {isValid: true, value} : wrong(problem);
}

function checkWhole(parameter: Parameter, draft: string): Checked {
  const typed = draft.trim();
  if (!kWhole.test(typed)) return wrong(texts.value.checks.typeWhole);
  const near = Number(typed);
  const problem = checkRange(parameter, near);
  if (problem !== null) return wrong(problem);
  return {isValid: true, value: Number.isSafeInteger(near) ? near : BigInt(typed)};
}

/**
 * The elements of a vector as typed. A comma in front of a space parts them in every format; one
 * between digits is the decimal mark, unless the mark is the point and nothing else parts them.
 */
function elementsOf(draft: string): string[] {
  const parts = draft.split(/;|,\s|\s|,$/).filter((part) => part.trim() !== '');
  const isAlone = parts.length === 1 && separator().startsWith(',');
  return isAlone ? draft.split(',').filter((part) => part.trim() !== '') : parts;
}

function checkVector(parameter: Parameter, draft: string): Checked {
  const words = texts.value.checks;
  const parts = elementsOf(draft);
  if (parts.length !== parameter.vectorSize) {
    return wrong(words.typeNumbers(parameter.vectorSize, parts.length));
  }
  const values: number[] = [];
  for (const [i, part] of parts.entries()) {
    const one = checkReal(parameter, part);
    if (!one.isValid) return wrong(words.element(i + 1, one.problem));
    values.push(one.value as number);
  }
  return {isValid: true, value: values};
}

/** Reads a draft as a value of the parameter, or says at the field what is wrong with it. */
export function check(parameter: Parameter, draft: string): Checked {
  switch (parameter.type) {
    case 'Bool':
      return {isValid: true, value: draft === 'true'};
    case 'Integer':
      return checkWhole(parameter, draft);
    case 'Real':
      return checkReal(parameter, draft);
    case 'Vector':
      return checkVector(parameter, draft);
    case 'Choice':
      return parameter.choices.includes(draft)
        ? {isValid: true, value: draft}
        : wrong(texts.value.checks.chooseOne(parameter.choices.join(', ')));
    case 'Text':
      return {isValid: true, value: draft};
  }
}

/** Why the parameter can't change now; null: it can. */
export function lockOf(parameter: Parameter, isActive: boolean): string | null {
  if (parameter.mutability === 'ReadOnly') return texts.value.checks.readOnly;
  if (parameter.mutability === 'Inactive' && isActive) return texts.value.checks.onlyInactive;
  return null;
}

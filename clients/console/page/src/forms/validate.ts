import type {Parameter, Value} from './parameter';

/** What is typed into a form, before anything is sent. */

export type Checked =
  | {readonly isValid: true; readonly value: Value}
  | {readonly isValid: false; readonly problem: string};

const kReal = /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i;
const kWhole = /^[+-]?\d+$/;

function wrong(problem: string): Checked {
  return {isValid: false, problem};
}

/** A number as people read it: no more digits than it has. */
export function numberText(value: number | bigint): string {
  if (typeof value === 'bigint') return value.toString();
  if (!Number.isFinite(value)) return value > 0 ? '∞' : value < 0 ? '−∞' : 'not a number';
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-4 || size >= 1e7)) return value.toExponential().replace('e+', 'e');
  return String(Number(value.toPrecision(12)));
}

function unitOf(parameter: Parameter): string {
  return parameter.unit === '' || parameter.unit === '1' ? '' : ` ${parameter.unit}`;
}

/** "0 to 0.5 s", "at least 0 m"; empty where any number will do. */
export function rangeText(parameter: Parameter): string {
  if (!['Integer', 'Real', 'Vector'].includes(parameter.type)) return '';
  const {low, high} = parameter;
  const unit = unitOf(parameter);
  if (Number.isFinite(low) && Number.isFinite(high)) {
    return `${numberText(low)} to ${numberText(high)}${unit}`;
  }
  if (Number.isFinite(low)) return `at least ${numberText(low)}${unit}`;
  return Number.isFinite(high) ? `at most ${numberText(high)}${unit}` : '';
}

/** What a field shows of a value, and what `check` reads back. */
export function valueText(value: Value): string {
  if (typeof value === 'object') return value.map(numberText).join(', ');
  if (typeof value === 'number' || typeof value === 'bigint') return numberText(value);
  return String(value);
}

function checkRange(parameter: Parameter, value: number): string | null {
  if (value >= parameter.low && value <= parameter.high) return null;
  const side = value < parameter.low ? 'below' : 'above';
  return `${numberText(value)} is ${side} the range: ${rangeText(parameter)}`;
}

function checkReal(parameter: Parameter, draft: string): Checked {
  const typed = draft.trim();
  if (typed === '') return wrong('Type a number.');
  if (!kReal.test(typed)) return wrong(`“${typed}” is not a number. Write it like 0.25 or 2.5e-3.`);
  const value = Number(typed);
  if (!Number.isFinite(value)) return wrong(`${typed} is too large for a number.`);
  const problem = checkRange(parameter, value);
  return problem === null ? {isValid: true, value} : wrong(`${problem}.`);
}

function checkWhole(parameter: Parameter, draft: string): Checked {
  const typed = draft.trim();
  if (!kWhole.test(typed)) return wrong('Type a whole number.');
  const near = Number(typed);
  const problem = checkRange(parameter, near);
  if (problem !== null) return wrong(`${problem}.`);
  return {isValid: true, value: Number.isSafeInteger(near) ? near : BigInt(typed)};
}

function checkVector(parameter: Parameter, draft: string): Checked {
  const parts = draft.split(/[,;\s]+/).filter((part) => part !== '');
  if (parts.length !== parameter.vectorSize) {
    return wrong(`Type ${parameter.vectorSize} numbers; there are ${parts.length}.`);
  }
  const values: number[] = [];
  for (const [i, part] of parts.entries()) {
    const one = checkReal(parameter, part);
    if (!one.isValid) return wrong(`Number ${i + 1}: ${one.problem}`);
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
        : wrong(`Choose one of: ${parameter.choices.join(', ')}.`);
    case 'Text':
      return {isValid: true, value: draft};
  }
}

/** Why the parameter can't change now; null: it can. */
export function lockOf(parameter: Parameter, isActive: boolean): string | null {
  if (parameter.mutability === 'ReadOnly') return 'Read only';
  if (parameter.mutability === 'Inactive' && isActive) {
    return 'Changes only while the device is inactive: deactivate it first';
  }
  return null;
}

import {describe, expect, it} from 'vitest';
import {Decoder, type Decoded} from '../src/flatbuffers/decode';
import {readSample, readTouch} from '../src/model/sample';
import {recorded, schemaBytes} from './recorded';

/** `rtpm echo` prints a fixed-size event without the table around its only field. */
function inner(value: Decoded): Decoded {
  return Object.values(value as Record<string, Decoded>)[0] ?? null;
}

function expectAlike(actual: unknown, expected: unknown, path = ''): void {
  if (typeof expected === 'number') {
    expect(Number(actual), path).toBeCloseTo(expected, 6);
  } else if (expected !== null && typeof expected === 'object') {
    expect(Object.keys(actual as object).sort(), path).toEqual(Object.keys(expected).sort());
    for (const [key, value] of Object.entries(expected)) {
      expectAlike((actual as Record<string, unknown>)[key], value, `${path}.${key}`);
    }
  } else {
    expect(actual, path).toBe(expected);
  }
}

/** `rtpm echo` prints enums by name. */
function withoutShape(value: unknown): unknown {
  const rest = {...(value as Record<string, unknown>)};
  delete rest['shape'];
  return rest;
}

describe('what C++ recorded', () => {
  it.each(recorded)(
    'decodes as rtpm echo printed it: $topic',
    ({schemaName, payload, expected}) => {
      const decoded = Decoder.of(schemaBytes(schemaName), schemaName).decode(payload);
      expectAlike(withoutShape(inner(decoded)), withoutShape(expected));
    },
  );

  it('is read as samples and touches', () => {
    const touched = recorded.find((one) => one.schemaName === 'rtpm.touch.Touched');
    const sampled = recorded.find((one) => one.topic === 'rtpm.device.Sampled/3571832195');
    const decode = (one: typeof touched) =>
      Decoder.of(schemaBytes(one!.schemaName), one!.schemaName).decode(one!.payload);
    const touch = readTouch(decode(touched));
    expect(touch?.shape).toBe('sphere');
    expect(touch?.deviceM[0]).toBeCloseTo(0.022876621616, 9);
    const sample = readSample(decode(sampled));
    expect(sample?.orientation).toEqual([0, 0, 0, 1]);
    expect(sample?.joints).toHaveLength(8);
  });

  it('has its arrays also by a schema that has a field for each element', () => {
    const name = 'rtpm.device.Sampled';
    const sampled = recorded.find((one) => one.schemaName === name)!;
    const flat = Decoder.of(schemaBytes(`${name} without arrays`), name);
    expect(flat.decode(sampled.payload)).toEqual(
      Decoder.of(schemaBytes(name), name).decode(sampled.payload),
    );
  });

  it('never reads past a payload that is cut short or damaged', () => {
    for (const {schemaName, payload} of recorded) {
      const decoder = Decoder.of(schemaBytes(schemaName), schemaName);
      for (let size = 0; size < payload.length; ++size) {
        try {
          decoder.decode(payload.slice(0, size));
        } catch (error) {
          expect(error).toBeInstanceOf(RangeError);
        }
      }
      for (let at = 0; at < payload.length; ++at) {
        const damaged = payload.slice();
        damaged[at] = 0xff;
        try {
          decoder.decode(damaged);
        } catch (error) {
          expect(error).toBeInstanceOf(RangeError);
        }
      }
    }
  });

  it('refuses a schema that is damaged or lacks the table', () => {
    const schema = schemaBytes('rtpm.touch.Touched');
    expect(() => Decoder.of(schema, 'rtpm.touch.Missing')).toThrow(RangeError);
    expect(() => Decoder.of(schema.slice(0, 40), 'rtpm.touch.Touched')).toThrow(RangeError);
    expect(() => Decoder.of(new Uint8Array(0), 'rtpm.touch.Touched')).toThrow(RangeError);
  });
});

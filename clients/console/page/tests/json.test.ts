import {describe, expect, it} from 'vitest';
import {parseJson, writeJson} from '../src/protocol/json';

describe('JSON', () => {
  it('keeps whole numbers beyond 2^53 exact, both ways', () => {
    const text = '{"revision":9306168900263608321,"low":-9223372036854775808,"count":12}';
    expect(parseJson(text)).toEqual({
      revision: 9306168900263608321n,
      low: -9223372036854775808n,
      count: 12,
    });
    expect(writeJson(parseJson(text))).toBe(text);
  });

  it('leaves digits within strings alone', () => {
    const text = '{"why":"got 9306168900263608321, \\"inf\\" and -inf","x":1.5e300}';
    expect(writeJson(parseJson(text))).toBe(
      '{"why":"got 9306168900263608321, \\"inf\\" and -inf",' + '"x":1.5e+300}',
    );
  });

  it('takes the digits behind a point for a fraction', () => {
    expect(parseJson('[0.034284587847524466,-0.93061689002636083,[1234567890123456789]]')).toEqual([
      0.034284587847524466,
      -0.93061689002636083,
      [1234567890123456789n],
    ]);
  });

  it('leaves the digits of fractions alone', () => {
    const text = '[0.07894561237894561234,-1.0000000000000002,1234567890123456.5]';
    expect(parseJson(text)).toEqual(JSON.parse(text));
  });

  it("reads FlatBuffers' inf, -inf and nan", () => {
    expect(parseJson('{"low": -inf, "high": inf, "value": nan}')).toEqual({
      low: -Infinity,
      high: Infinity,
      value: NaN,
    });
  });

  it('refuses what is not JSON', () => {
    for (const broken of ['', '{', '{"a":}', 'infinity', '[1,]']) {
      expect(() => parseJson(broken), broken).toThrow(SyntaxError);
    }
  });
});

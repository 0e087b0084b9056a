import {readFileSync} from 'node:fs';
import {describe, expect, it} from 'vitest';
import {inspect, pictureIn} from '../src/model/picture';

// Messages that rtpm-console sent.
const recorded = JSON.parse(
  readFileSync(new URL('./fixtures/pictures.json', import.meta.url), 'utf8'),
) as Record<string, string[]>;
const messages = (codec: string) =>
  (recorded[codec] ?? []).map((one) => new Uint8Array(Buffer.from(one, 'base64')));

describe('pictures', () => {
  it('of JPEG are found in their message', () => {
    for (const message of messages('jpeg')) {
      const picture = pictureIn(message);
      expect([...picture.subarray(0, 2)]).toEqual([0xff, 0xd8]);
      expect([...picture.subarray(-2)]).toEqual([0xff, 0xd9]);
    }
  });

  it('of H.264 tell whether they are key frames, and their codec', () => {
    const [key, next] = messages('h264').map((one) => inspect(pictureIn(one)));
    expect(key).toEqual({isKey: true, codec: 'avc1.42c015'});
    expect(next).toEqual({isKey: false, codec: ''});
  });

  it('that are cut short are refused', () => {
    const message = messages('jpeg')[0] ?? new Uint8Array();
    expect(() => pictureIn(message.subarray(0, message.length / 2))).toThrow(RangeError);
  });
});

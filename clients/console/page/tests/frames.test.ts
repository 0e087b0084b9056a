import {afterEach, beforeEach, expect, it, vi} from 'vitest';

import {eachFrame} from '../src/store/frames';

let frame: ((nowMs: number) => void) | null = null;

beforeEach(() => {
  vi.stubGlobal('requestAnimationFrame', (next: (nowMs: number) => void) => {
    frame = next;
    return 1;
  });
});
afterEach(() => vi.unstubAllGlobals());

/** The times at which it painted, where each frame ends at the next of `endsMs`. */
function paintedAt(endsMs: readonly number[]): readonly number[] {
  const painted: number[] = [];
  const end = eachFrame((nowMs) => painted.push(nowMs));
  for (const endMs of endsMs) frame?.(endMs);
  end();
  frame?.((endsMs.at(-1) ?? 0) + 1000);
  return painted;
}

it('paints each frame of a quick screen', () => {
  const frames = [1000, 1016, 1033, 1050];
  expect(paintedAt(frames)).toEqual(frames);
});

it('rests as long as a slow frame took', () => {
  const painted = paintedAt([5000, 5100, 5116, 5150, 5200, 5300, 5399, 5400]);
  expect(painted).toEqual([5000, 5200, 5400]);
});

it('paints soon after the page was hidden', () => {
  expect(paintedAt([9000, 3_609_000, 3_609_250])).toEqual([9000, 3_609_250]);
});

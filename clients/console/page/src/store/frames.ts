/** Paints by requestAnimationFrame: never faster than the screen, and not at all while hidden. */

type Paint = (nowMs: number) => void;

/** Two frames of a usual screen. A frame that takes longer is drawn without a graphics processor. */
const kSlowMs = 34;
/** A page that was hidden shows at once. */
const kRestMaxMs = 250;

const painters = new Set<Paint>();
let request = 0;
let paintedMs: number | null = null;
let dueMs = 0;

function paintAll(nowMs: number): void {
  request = painters.size > 0 ? requestAnimationFrame(paintAll) : 0;
  // After a slow frame the page rests for as long, so that presses and keys are answered.
  const tookMs = paintedMs === null ? 0 : nowMs - paintedMs;
  if (tookMs > kSlowMs) dueMs = nowMs + Math.min(tookMs, kRestMaxMs);
  paintedMs = nowMs >= dueMs ? nowMs : null;
  if (paintedMs !== null) painters.forEach((paint) => paint(nowMs));
}

/** Calls `paint` for each frame until the returned function is called. */
export function eachFrame(paint: Paint): () => void {
  painters.add(paint);
  if (request === 0) request = requestAnimationFrame(paintAll);
  return () => painters.delete(paint);
}

/** Paints by requestAnimationFrame: never faster than the screen, and not at all while hidden. */

type Paint = (nowMs: number) => void;

const painters = new Set<Paint>();
let request = 0;

function paintAll(nowMs: number): void {
  request = painters.size > 0 ? requestAnimationFrame(paintAll) : 0;
  painters.forEach((paint) => paint(nowMs));
}

/** Calls `paint` for each frame until the returned function is called. */
export function eachFrame(paint: Paint): () => void {
  painters.add(paint);
  if (request === 0) request = requestAnimationFrame(paintAll);
  return () => painters.delete(paint);
}

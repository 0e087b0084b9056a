import type {Curve, Happening, HappeningKind} from '../model/review';
import {
  digitsFor,
  momentText,
  shareOf,
  stepFor,
  ticksOf,
  valueText,
  type Span,
} from '../model/span';
import {colour} from '../store/theme';

/** The common part of a review's canvases: times of axes, curves, and what happened. */

export interface Frame {
  readonly context: CanvasRenderingContext2D;
  readonly left: number;
  readonly top: number;
  readonly width: number;
  readonly height: number;
  readonly span: Span;
}

/** Each has a shape of its own, so that its colour says nothing alone. Paths around 0, 6 px wide. */
export const kShapes: Readonly<Record<HappeningKind, {path: string; paint: string}>> = {
  marker: {path: 'M-4 -6L5.5 -2.5L-2 .5V6H-4Z', paint: 'accent'},
  trial: {path: 'M-6 -3H6V3H-6Z', paint: 'replay'},
  note: {path: 'M-5 -5H5V2H1L-2 6V2H-5Z', paint: 'good'},
  fault: {path: 'M0 -6L6 5H-6Z', paint: 'bad'},
  stop: {path: 'M-2.3 -5.5H2.3L5.5 -2.3V2.3L2.3 5.5H-2.3L-5.5 2.3V-2.3Z', paint: 'stop'},
  lost: {path: 'M-5 -3L-3 -5L0 -2L3 -5L5 -3L2 0L5 3L3 5L0 2L-3 5L-5 3L-2 0Z', paint: 'bad'},
  lease: {path: 'M0 -5.5L5.5 0L0 5.5L-5.5 0Z', paint: 'quiet'},
};

/** Clears a canvas at the resolution of the screen; null while it has no size. */
export function beginFrame(
  canvas: HTMLCanvasElement,
): {context: CanvasRenderingContext2D; width: number; height: number} | null {
  const context = canvas.getContext('2d');
  const {clientWidth: width, clientHeight: height} = canvas;
  if (context === null || width === 0 || height === 0) return null;
  const ratio = window.devicePixelRatio;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = '12px system-ui, sans-serif';
  context.lineJoin = 'round';
  return {context, width, height};
}

export function xOf(frame: Frame, timeS: number): number {
  return frame.left + shareOf(frame.span, timeS) * frame.width;
}

/** Lines at round moments, with their times below. */
export function drawTimes(frame: Frame): void {
  const {context, top, height, left, width} = frame;
  const labelPx = 78;
  const stepS = stepFor(frame.span.toS - frame.span.fromS, Math.floor(width / labelPx));
  const digits = digitsFor(stepS);
  context.strokeStyle = colour('line');
  context.fillStyle = colour('quiet');
  context.lineWidth = 1;
  context.textAlign = 'center';
  context.textBaseline = 'top';
  for (const tickS of ticksOf(frame.span, stepS)) {
    const x = Math.round(xOf(frame, tickS)) + 0.5;
    context.beginPath();
    context.moveTo(x, top);
    context.lineTo(x, top + height);
    context.stroke();
    const text = momentText(tickS, digits);
    const half = context.measureText(text).width / 2;
    context.fillText(
      text,
      Math.min(Math.max(x, left + half - 8), left + width - half + 8),
      top + height + 5,
    );
  }
}

/** Lines at round values, with their numbers left of them. */
export function drawValues(
  frame: Frame,
  axis: {readonly low: number; readonly high: number; readonly ticks: readonly number[]},
): void {
  const {context, left, width} = frame;
  context.strokeStyle = colour('line');
  context.fillStyle = colour('quiet');
  context.lineWidth = 1;
  context.textAlign = 'right';
  context.textBaseline = 'middle';
  for (const tick of axis.ticks) {
    const y = Math.round(yOf(frame, axis, tick)) + 0.5;
    context.beginPath();
    context.moveTo(left, y);
    context.lineTo(left + width, y);
    context.stroke();
    context.fillText(valueText(tick), left - 6, y);
  }
}

export function yOf(
  frame: Frame,
  axis: {readonly low: number; readonly high: number},
  value: number,
): number {
  return frame.top + frame.height * (1 - (value - axis.low) / (axis.high - axis.low));
}

/** Samples as a line with dots where there is room; steps as the area between their bounds. */
export function drawCurve(
  frame: Frame,
  curve: Curve,
  axis: {readonly low: number; readonly high: number},
  paint: string,
): void {
  const {context, left, top, width, height} = frame;
  context.save();
  context.beginPath();
  context.rect(left, top, width, height);
  context.clip();
  context.strokeStyle = context.fillStyle = colour(paint);
  context.lineWidth = 1.5;
  const y = (value: number) => yOf(frame, axis, value);
  if (curve.kind === 'samples') {
    context.beginPath();
    curve.times.forEach((timeS, i) => context.lineTo(xOf(frame, timeS), y(curve.values[i] ?? 0)));
    context.stroke();
    const shown = curve.times.filter((t) => t >= frame.span.fromS && t <= frame.span.toS).length;
    if (shown * 7 <= width) {
      curve.times.forEach((timeS, i) => {
        context.beginPath();
        context.arc(xOf(frame, timeS), y(curve.values[i] ?? 0), 2.5, 0, 2 * Math.PI);
        context.fill();
      });
    }
    context.restore();
    return;
  }
  // Each step from its low to its high, linked to the next: as the samples would be painted.
  context.beginPath();
  let before: {x: number; low: number; high: number} | null = null;
  curve.low.forEach((low, i) => {
    const high = curve.high[i] ?? null;
    if (low === null || high === null) return;
    const x = xOf(frame, curve.beginS + (i + 0.5) * curve.stepS);
    if (x < left - width || x > left + 2 * width) return;
    const [lowY, highY] = [y(low), y(high)];
    if (before !== null) {
      context.moveTo(before.x, (before.low + before.high) / 2);
      context.lineTo(x, (lowY + highY) / 2);
    }
    context.moveTo(x, lowY + 0.5);
    context.lineTo(x, highY - 0.5);
    before = {x, low: lowY, high: highY};
  });
  context.stroke();
  context.restore();
}

/** The symbol of something that happened, around a point. */
export function drawSymbol(
  context: CanvasRenderingContext2D,
  kind: HappeningKind,
  x: number,
  y: number,
): void {
  const {path, paint} = kShapes[kind];
  const shape = new Path2D(path);
  context.save();
  context.translate(x, y);
  context.fillStyle = colour(paint);
  context.strokeStyle = colour('surface');
  context.lineWidth = 1;
  context.fill(shape);
  context.stroke(shape);
  context.restore();
}

/** Trials as bands with their numbers, in a row. */
export function drawTrials(
  frame: Frame,
  happenings: readonly Happening[],
  originS: number,
  top: number,
  height: number,
): void {
  const {context, left, width} = frame;
  context.save();
  context.beginPath();
  context.rect(left, top, width, height);
  context.clip();
  context.textBaseline = 'middle';
  context.textAlign = 'left';
  for (const one of happenings) {
    if (one.kind !== 'trial') continue;
    const from = xOf(frame, one.atS - originS);
    const to = one.endS === null ? left + width : xOf(frame, one.endS - originS);
    if (to < left || from > left + width) continue;
    context.fillStyle = colour('replay-soft');
    context.strokeStyle = colour('replay');
    context.lineWidth = 1;
    const shownPx = Math.max(to - from - 1, 2);
    context.fillRect(from, top, shownPx, height);
    context.strokeRect(from + 0.5, top + 0.5, shownPx, height - 1);
    const text = one.text === '' ? String(one.number) : `${one.number} ${one.text}`;
    const roomPx = Math.min(to, left + width) - Math.max(from, left) - 8;
    context.fillStyle = colour('replay');
    const whole = context.measureText(text).width <= roomPx ? text : String(one.number);
    if (context.measureText(whole).width <= roomPx) {
      context.fillText(whole, Math.max(from, left) + 4, top + height / 2 + 0.5);
    }
  }
  context.restore();
}

/** A line at a moment, dashed where it is pinned. */
export function drawMoment(frame: Frame, timeS: number, paint: string, isDashed: boolean): void {
  const x = xOf(frame, timeS);
  if (x < frame.left - 0.5 || x > frame.left + frame.width + 0.5) return;
  const {context, top, height} = frame;
  context.save();
  context.strokeStyle = colour(paint);
  context.lineWidth = 1.25;
  if (isDashed) context.setLineDash([5, 4]);
  context.beginPath();
  context.moveTo(x, top);
  context.lineTo(x, top + height);
  context.stroke();
  context.restore();
}

export function drawBrush(frame: Frame, brush: Span): void {
  const {context, top, height} = frame;
  const from = xOf(frame, brush.fromS);
  const to = xOf(frame, brush.toS);
  context.save();
  context.fillStyle = colour('accent');
  context.globalAlpha = 0.16;
  context.fillRect(from, top, to - from, height);
  context.globalAlpha = 1;
  context.strokeStyle = colour('accent');
  context.strokeRect(from + 0.5, top + 0.5, to - from, height - 1);
  context.restore();
}

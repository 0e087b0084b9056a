import {shareOfValue, type ValueAxis} from '../model/axis';
import {rowAt, type Points} from '../model/points';
import {shareOf, stepFor, ticksOf, type Span} from '../model/span';
import {colour} from '../store/theme';

/** Charts are painted of a frame, axes, and curves. */

/** The rectangle of the curves, in pixels of the style sheet. */
export interface Frame {
  readonly context: CanvasRenderingContext2D;
  readonly left: number;
  readonly top: number;
  readonly width: number;
  readonly height: number;
  readonly span: Span;
}

/** Around the curves: units and marks above, times below, an axis of values at each side. */
const kTopPx = 20;
const kBottomPx = 24;
const kAxisPx = 58;
const kSidePx = 14;
const kFont = '12px system-ui, sans-serif';
const kCurvePx = 1.75;
const kDotPx = 2.5;
/** Values that are farther from each other have dots. */
const kDotRoomPx = 7;
const kTimePx = 84;
const kValuePx = 28;

export interface Size {
  readonly width: number;
  readonly height: number;
}

/** Left and right of the curves, where there are so many axes of values. */
export function sidesOf(axisCount: number): {readonly leftPx: number; readonly rightPx: number} {
  const rightCount = Math.floor(axisCount / 2);
  return {
    leftPx: kAxisPx * Math.max(1, axisCount - rightCount),
    rightPx: Math.max(kSidePx, kAxisPx * rightCount),
  };
}

/** The number of ticks of values that have room. */
export function tickMax({height}: Size): number {
  return Math.max(2, Math.floor((height - kTopPx - kBottomPx) / kValuePx));
}

/** A canvas that is cleared, at the resolution of the screen; null while it has no size. */
export function beginFrame(canvas: HTMLCanvasElement): CanvasRenderingContext2D | null {
  const context = canvas.getContext('2d');
  const {clientWidth, clientHeight} = canvas;
  if (context === null || clientWidth === 0 || clientHeight === 0) return null;
  const ratio = window.devicePixelRatio;
  const [width, height] = [Math.round(clientWidth * ratio), Math.round(clientHeight * ratio)];
  if (canvas.width !== width || canvas.height !== height) {
    canvas.width = width;
    canvas.height = height;
  }
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, clientWidth, clientHeight);
  context.font = kFont;
  context.lineJoin = context.lineCap = 'round';
  return context;
}

export function frameOf(
  context: CanvasRenderingContext2D,
  {width, height}: Size,
  axisCount: number,
  span: Span,
): Frame {
  const {leftPx: left, rightPx} = sidesOf(axisCount);
  return {
    context,
    span,
    left,
    top: kTopPx,
    width: Math.max(width - left - rightPx, 1),
    height: Math.max(height - kTopPx - kBottomPx, 1),
  };
}

export function xOf(frame: Frame, timeS: number): number {
  return frame.left + shareOf(frame.span, timeS) * frame.width;
}

export function yOf(frame: Frame, axis: ValueAxis, value: number): number {
  return frame.top + frame.height * (1 - shareOfValue(axis, value));
}

export function line(frame: Frame, x: number, y: number, toX: number, toY: number): void {
  const {context} = frame;
  context.beginPath();
  context.moveTo(x, y);
  context.lineTo(toX, toY);
  context.stroke();
}

/** Paints inside of the frame only. */
export function clipped(frame: Frame, paint: () => void): void {
  const {context, left, top, width, height} = frame;
  context.save();
  context.beginPath();
  context.rect(left, top, width, height);
  context.clip();
  paint();
  context.restore();
}

/** Lines at round times, which count from `zeroS`, with their names below. */
export function drawTimes(
  frame: Frame,
  zeroS: number,
  name: (timeS: number, stepS: number) => string,
): void {
  const {context, top, height, left, width, span} = frame;
  const stepS = stepFor(span.toS - span.fromS, Math.floor(width / kTimePx));
  context.strokeStyle = colour('line');
  context.fillStyle = colour('quiet');
  context.lineWidth = 1;
  context.textAlign = 'center';
  context.textBaseline = 'top';
  for (const tickS of ticksOf({fromS: span.fromS - zeroS, toS: span.toS - zeroS}, stepS)) {
    const x = Math.round(xOf(frame, tickS + zeroS)) + 0.5;
    line(frame, x, top, x, top + height);
    const text = name(tickS + zeroS, stepS);
    const half = context.measureText(text).width / 2;
    const [least, most] = [left + half - 4, left + width - half + kSidePx];
    context.fillText(text, Math.min(Math.max(x, least), most), top + height + 6);
  }
}

/** The numbers of an axis beside it, and its unit above; the first axis has lines. */
export function drawValues(frame: Frame, axis: ValueAxis, index: number): void {
  const {context, left, top, width} = frame;
  const isLeft = index % 2 === 0;
  const outPx = Math.floor(index / 2) * kAxisPx + 6;
  const x = isLeft ? left - outPx : left + width + outPx;
  context.strokeStyle = colour('line');
  context.fillStyle = colour('quiet');
  context.lineWidth = 1;
  context.textAlign = isLeft ? 'right' : 'left';
  context.textBaseline = 'middle';
  for (const {value, text} of axis.ticks) {
    const y = Math.round(yOf(frame, axis, value)) + 0.5;
    if (index === 0) line(frame, left, y, left + width, y);
    context.fillText(text, x, y);
  }
  context.font = `600 ${kFont}`;
  context.fillStyle = colour('text');
  context.fillText(axis.scale.unit, x, top - 11);
  context.font = kFont;
}

/** A line through the points, from the lowest to the highest value of each; dots where they have room. */
export function drawCurve(
  frame: Frame,
  {times, ends, low, high}: Points,
  axis: ValueAxis,
  {paint, isDashed = false}: {readonly paint: string; readonly isDashed?: boolean},
): void {
  const {context, span, width} = frame;
  const first = Math.max(0, rowAt(times, span.fromS) - 1);
  const last = Math.min(times.length, rowAt(times, span.toS) + 1);
  const hasDots = (last - first) * kDotRoomPx <= width;
  context.strokeStyle = context.fillStyle = colour(paint);
  context.lineWidth = kCurvePx;
  if (isDashed) context.setLineDash([6, 4]);
  context.beginPath();
  let before = NaN;
  for (let i = first; i < last; ++i) {
    const x = xOf(frame, times[i] ?? NaN);
    const endX = xOf(frame, ends[i] ?? NaN);
    const lowY = yOf(frame, axis, low[i] ?? NaN);
    const highY = yOf(frame, axis, high[i] ?? NaN);
    const isNew = Number.isNaN(before);
    // The nearer end first, so that a line that falls has no teeth.
    const isLowFirst = isNew || Math.abs(lowY - before) <= Math.abs(highY - before);
    const [firstY, lastY] = isLowFirst ? [lowY, highY] : [highY, lowY];
    before = lastY;
    if (Number.isNaN(lastY)) continue;
    if (isNew) context.moveTo(x, firstY);
    else context.lineTo(x, firstY);
    // Also where both are the same: a value between two gaps is a point.
    if (isNew || firstY !== lastY) context.lineTo(endX, lastY);
  }
  context.stroke();
  context.setLineDash([]);
  for (let i = first; hasDots && i < last; ++i)
    if (low[i] === high[i]) drawDot(frame, axis, times[i] ?? NaN, low[i] ?? NaN, paint);
}

export function drawDot(
  frame: Frame,
  axis: ValueAxis,
  timeS: number,
  value: number,
  paint: string,
): void {
  const {context} = frame;
  context.fillStyle = colour(paint);
  context.beginPath();
  context.arc(xOf(frame, timeS), yOf(frame, axis, value), kDotPx, 0, 2 * Math.PI);
  context.fill();
}

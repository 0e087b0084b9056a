import type {ValueAxis} from '../model/axis';
import {valueAt, type Points} from '../model/points';
import type {Span} from '../model/span';
import {colour} from '../store/theme';
import {
  clipped,
  drawCurve,
  drawDot,
  drawTimes,
  drawValues,
  frameOf,
  line,
  xOf,
  yOf,
  type Frame,
  type Size,
} from './canvas';
import {drawMoments, drawTrials, type Mark} from './marks';

const kColourCount = 8;

export interface Line {
  readonly points: Points;
  /** Its place among the axes. */
  readonly axis: number;
  /** A colour's name in the style sheet. */
  readonly paint: string;
  readonly isDashed?: boolean;
}

/** A line at a value, with its name. */
export interface Limit {
  readonly axis: number;
  readonly value: number;
  readonly label: string;
}

/** All that a chart shows. Times are in seconds, values as measured. */
export interface Scene {
  readonly span: Span;
  /** Times count from here. */
  readonly zeroS: number;
  /** The name of a moment, where moments in this distance are told apart. */
  readonly timeText: (timeS: number, stepS: number) => string;
  readonly axes: readonly ValueAxis[];
  readonly lines: readonly Line[];
  readonly limits: readonly Limit[];
  readonly marks: readonly Mark[];
  readonly crossS: number | null;
  /** Stays while the crosshair is elsewhere. */
  readonly pinnedS: number | null;
  /** The part that a pointer draws. */
  readonly brush: Span | null;
  /** The part that other charts show; the rest is dimmed. */
  readonly window: Span | null;
}

/** Most charts have none of these. */
export const kPlain = {
  zeroS: 0,
  limits: [],
  pinnedS: null,
  brush: null,
  window: null,
} as const;

/** The name of the colour of a curve, by its place. */
export function curveColour(index: number): string {
  return `curve-${1 + (index % kColourCount)}`;
}

/** With more curves than colours, they are dashed. */
export function isDashed(index: number): boolean {
  return index >= kColourCount;
}

export function drawScene(context: CanvasRenderingContext2D, size: Size, scene: Scene): Frame {
  const {axes, lines, marks, crossS, pinnedS, brush} = scene;
  const frame = frameOf(context, size, axes.length, scene.span);
  const {top, height} = frame;
  clipped(frame, () => drawTrials(frame, marks));
  drawTimes(frame, scene.zeroS, scene.timeText);
  axes.forEach((axis, i) => drawValues(frame, axis, i));
  clipped(frame, () => {
    for (const one of lines) {
      const axis = axes[one.axis];
      if (axis !== undefined) drawCurve(frame, one.points, axis, one);
    }
    for (const one of scene.limits) drawLimit(frame, one, axes[one.axis]);
    if (brush !== null) drawBrush(frame, brush);
    if (pinnedS !== null) {
      context.strokeStyle = colour('text');
      context.setLineDash([5, 4]);
      line(frame, xOf(frame, pinnedS), top, xOf(frame, pinnedS), top + height);
      context.setLineDash([]);
    }
    if (crossS !== null) drawCrossed(frame, scene, crossS);
  });
  if (scene.window !== null) drawWindow(frame, scene.window);
  drawMoments(frame, marks);
  return frame;
}

/** A dot where the crosshair meets a curve. */
function drawCrossed(frame: Frame, {axes, lines}: Scene, crossS: number): void {
  for (const {points, axis: at, paint} of lines) {
    const value = valueAt(points, crossS);
    const axis = axes[at];
    if (value === null || axis === undefined) continue;
    drawDot(frame, axis, crossS, (value.low + value.high) / 2, paint);
  }
}

function drawLimit(frame: Frame, {value, label}: Limit, axis: ValueAxis | undefined): void {
  if (axis === undefined) return;
  const {context, left, width} = frame;
  const y = yOf(frame, axis, value);
  context.strokeStyle = context.fillStyle = colour('bad');
  context.lineWidth = 1.5;
  context.textAlign = 'right';
  context.textBaseline = 'bottom';
  context.setLineDash([6, 4]);
  line(frame, left, y, left + width, y);
  context.setLineDash([]);
  context.fillText(label, left + width - 6, y - 2);
}

function drawWindow(frame: Frame, window: Span): void {
  const {context, left, top, width, height} = frame;
  const [from, to] = [xOf(frame, window.fromS), xOf(frame, window.toS)];
  context.fillStyle = colour('ground');
  context.globalAlpha = 0.66;
  context.fillRect(left, top, Math.max(from - left, 0), height);
  context.fillRect(to, top, Math.max(left + width - to, 0), height);
  context.globalAlpha = 1;
  context.strokeStyle = context.fillStyle = colour('accent');
  context.lineWidth = 1.5;
  context.strokeRect(from, top + 0.75, Math.max(to - from, 2), height - 1.5);
  for (const x of [from, Math.max(to, from + 2)])
    context.fillRect(x - 2.5, top + height / 2 - 11, 5, 22);
}

function drawBrush(frame: Frame, brush: Span): void {
  const {context, top, height} = frame;
  const [from, to] = [xOf(frame, brush.fromS), xOf(frame, brush.toS)];
  context.fillStyle = context.strokeStyle = colour('accent');
  context.lineWidth = 1;
  context.globalAlpha = 0.16;
  context.fillRect(from, top, to - from, height);
  context.globalAlpha = 1;
  context.strokeRect(from + 0.5, top + 0.5, to - from, height - 1);
}

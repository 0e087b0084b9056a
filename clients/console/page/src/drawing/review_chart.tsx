import type {JSX} from 'preact';
import {useEffect, useRef} from 'preact/hooks';
import {
  rangeOf,
  shortName,
  valueAt,
  type Curve,
  type Happening,
  type ReviewField,
} from '../model/review';
import {lengthText, momentText, valueAxis, valueText, type Span} from '../model/span';
import {themeVersion} from '../store/theme';
import {texts} from '../texts/texts';
import {
  beginFrame,
  drawBrush,
  drawCurve,
  drawMoment,
  drawSymbol,
  drawTimes,
  drawTrials,
  drawValues,
  xOf,
  yOf,
  type Frame,
} from './review_canvas';
import {attachGestures, takeKey, type TimeAxis} from './time_gestures';

/** The properties that all charts of a review share. Its times are those of the axis, not of the recording. */
export interface Shared {
  readonly span: Span;
  readonly whole: Span;
  readonly hoverS: number | null;
  readonly pinnedS: number | null;
  readonly brushed: Span | null;
  readonly setSpan: (span: Span) => void;
  readonly hover: (atS: number | null) => void;
  readonly pin: (atS: number) => void;
  readonly brush: (span: Span | null) => void;
}

const kLeftPx = 58;
const kRightPx = 14;
const kPaints = ['x', 'y', 'z', 'force', 'accent', 'replay', 'tool', 'quiet'];

export function paintOf(index: number): string {
  return kPaints[index % kPaints.length] ?? 'x';
}

/** The plot's canvas, and its pointer and keys. */
function usePlot(axis: TimeAxis, paint: (canvas: HTMLCanvasElement) => void) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const latest = useRef(axis);
  latest.current = axis;
  const painter = useRef(paint);
  painter.current = paint;
  const version = themeVersion.value;
  useEffect(() => {
    const element = canvas.current;
    if (element === null) return undefined;
    const detach = attachGestures(element, () => latest.current);
    const observer = new ResizeObserver(() => painter.current(element));
    observer.observe(element);
    return () => {
      detach();
      observer.disconnect();
    };
  }, []);
  useEffect(() => {
    const element = canvas.current;
    if (element === null) return undefined;
    const request = requestAnimationFrame(() => painter.current(element));
    return () => cancelAnimationFrame(request);
  }, [paint, version]);
  const onKeyDown = (event: JSX.TargetedKeyboardEvent<HTMLCanvasElement>) => {
    if (takeKey(event, latest.current)) event.preventDefault();
  };
  return {canvas, onKeyDown};
}

/** The pinned moment as a slider has it, for keys and for those who hear the page. */
function sliderOf(shared: Shared, originS: number, label: string) {
  const atS = shared.pinnedS ?? shared.span.fromS;
  return {
    role: 'slider' as const,
    tabIndex: 0,
    'aria-label': label,
    'aria-valuemin': shared.whole.fromS + originS,
    'aria-valuemax': shared.whole.toS + originS,
    'aria-valuenow': atS + originS,
    'aria-valuetext': texts.value.review.slider(
      momentText(atS + originS, 3),
      momentText(shared.span.fromS + originS, 3),
      momentText(shared.span.toS + originS, 3),
    ),
  };
}

interface ChartProps {
  readonly shared: Shared;
  /** The recording's time where the axis has 0. */
  readonly originS: number;
  readonly name: string;
  readonly fields: readonly ReviewField[];
  readonly curves: ReadonlyMap<string, Curve>;
  /** The bounds of the values, where another chart has the same. */
  readonly range: {readonly low: number; readonly high: number} | null;
  readonly happenings: readonly Happening[];
  readonly onRemove: (path: string) => void;
}

/** Fields of one unit over time, with their values at the crosshair. */
export function ReviewChart(props: ChartProps) {
  const {shared, originS, fields, curves} = props;
  const words = texts.value.review;
  const unit = fields[0]?.unit ?? '';
  const paint = (canvas: HTMLCanvasElement) => paintChart(canvas, props);
  const {canvas, onKeyDown} = usePlot(
    {...shared, view: shared.span, leftPx: kLeftPx, rightPx: kRightPx},
    paint,
  );
  const atS = shared.hoverS ?? shared.pinnedS;
  const topics = new Set(fields.map((one) => shortName(one.path).topic));
  const title = `${[...topics].join(', ')}${unit === '' || unit === '1' ? '' : ` [${unit}]`}`;
  return (
    <figure class="review-chart" data-testid="review-chart">
      <figcaption class="review-legend">
        <span class="review-title">{title}</span>
        {fields.map((field, i) => {
          const {topic, name} = shortName(field.path);
          const curve = curves.get(field.path);
          const value = atS === null || curve === undefined ? null : valueAt(curve, atS + originS);
          const shown = topics.size > 1 ? `${topic} ${name}` : name;
          return (
            <span key={field.path} class="review-value">
              <i style={{background: `var(--${paintOf(i)})`}} />
              <span class="review-name">{shown}</span>
              <b>{value === null ? '–' : boundsText(value)}</b>
              <button
                type="button"
                class="review-remove"
                aria-label={words.removeField(field.path)}
                title={words.removeField(field.path)}
                onClick={() => props.onRemove(field.path)}
              >
                ×
              </button>
            </span>
          );
        })}
      </figcaption>
      <canvas
        ref={canvas}
        class="review-plot"
        onKeyDown={onKeyDown}
        {...sliderOf(shared, originS, words.chart(`${props.name} ${title}`))}
      />
    </figure>
  );
}

function boundsText({low, high}: {low: number; high: number}): string {
  const [a, b] = [valueText(low), valueText(high)];
  return a === b ? a : `${a} … ${b}`;
}

export function boundsOf(
  fields: readonly ReviewField[],
  curves: ReadonlyMap<string, Curve>,
  span: Span,
  originS: number,
): {readonly low: number; readonly high: number} | null {
  let [low, high] = [Infinity, -Infinity];
  for (const field of fields) {
    const curve = curves.get(field.path);
    const range = curve && rangeOf(curve, span.fromS + originS, span.toS + originS);
    if (!range) continue;
    low = Math.min(low, range.low);
    high = Math.max(high, range.high);
  }
  return high >= low ? {low, high} : null;
}

function paintChart(canvas: HTMLCanvasElement, props: ChartProps): void {
  const begun = beginFrame(canvas);
  if (begun === null) return;
  const {shared, originS, fields, curves} = props;
  const frame: Frame = {
    context: begun.context,
    left: kLeftPx,
    top: 8,
    width: Math.max(begun.width - kLeftPx - kRightPx, 1),
    height: Math.max(begun.height - 8 - 24, 1),
    span: shared.span,
  };
  const inRun: Frame = {
    ...frame,
    span: {fromS: shared.span.fromS + originS, toS: shared.span.toS + originS},
  };
  const {low, high} = props.range ?? {low: Infinity, high: -Infinity};
  const axis = valueAxis(low, high, Math.max(2, Math.floor(frame.height / 36)));
  drawTimes(inRun);
  drawValues(frame, axis);
  for (const one of props.happenings) {
    if (one.kind === 'trial') continue;
    drawMoment(inRun, one.atS, one.kind === 'marker' ? 'accent' : 'quiet', true);
  }
  fields.forEach((field, i) => {
    const curve = curves.get(field.path);
    if (curve !== undefined) drawCurve(inRun, curve, axis, paintOf(i));
  });
  for (const one of props.happenings) {
    const x = xOf(inRun, one.atS);
    if (one.kind !== 'trial' && x >= frame.left && x <= frame.left + frame.width) {
      drawSymbol(frame.context, one.kind, x, frame.top + 6);
    }
  }
  if (shared.brushed !== null) drawBrush(frame, shared.brushed);
  if (shared.pinnedS !== null) drawMoment(frame, shared.pinnedS, 'text', true);
  const {hoverS} = shared;
  if (hoverS === null) return;
  drawMoment(frame, hoverS, 'quiet', false);
  const {context} = frame;
  fields.forEach((field, i) => {
    const curve = curves.get(field.path);
    const value = curve && valueAt(curve, hoverS + originS);
    if (!value) return;
    context.fillStyle = getComputedStyle(canvas).getPropertyValue(`--${paintOf(i)}`);
    context.beginPath();
    context.arc(xOf(frame, hoverS), yOf(frame, axis, (value.low + value.high) / 2), 3, 0, 7);
    context.fill();
  });
}

interface StripProps {
  readonly shared: Shared;
  readonly originS: number;
  readonly name: string;
  readonly lengthS: number;
  readonly progress: number;
  readonly field: string;
  readonly curve: Curve | null;
  readonly happenings: readonly Happening[];
}

const kStripSidePx = 14;
const kSymbolPx = 18;
const kTrialPx = 18;
const kHandlePx = 10;

/** The whole recording at a glance; the part that shows below is a window that can be moved. */
export function OverviewStrip(props: StripProps) {
  const {shared} = props;
  const words = texts.value.review;
  const grip = useRef<{kind: 'from' | 'to' | 'move'; downS: number; span: Span} | null>(null);
  const paint = (canvas: HTMLCanvasElement) => paintStrip(canvas, props);
  const {canvas, onKeyDown} = usePlot(
    {...shared, view: shared.whole, leftPx: kStripSidePx, rightPx: kStripSidePx},
    paint,
  );
  const timeOf = (event: JSX.TargetedPointerEvent<HTMLCanvasElement>) => {
    const box = event.currentTarget.getBoundingClientRect();
    const width = Math.max(box.width - 2 * kStripSidePx, 1);
    const share = Math.min(1, Math.max(0, (event.clientX - box.left - kStripSidePx) / width));
    return {
      atS: shared.whole.fromS + share * (shared.whole.toS - shared.whole.fromS),
      perPx: (shared.whole.toS - shared.whole.fromS) / width,
    };
  };
  // A press inside of the window moves it, at an edge it changes that; else a new one is drawn.
  const onDown = (event: JSX.TargetedPointerEvent<HTMLCanvasElement>) => {
    const {atS, perPx} = timeOf(event);
    const {span, whole} = shared;
    const isWhole = span.toS - span.fromS >= 0.999 * (whole.toS - whole.fromS);
    const near = kHandlePx * perPx;
    if (isWhole) return;
    const kind =
      Math.abs(atS - span.fromS) < near
        ? 'from'
        : Math.abs(atS - span.toS) < near
          ? 'to'
          : atS > span.fromS && atS < span.toS
            ? 'move'
            : null;
    if (kind === null) return;
    grip.current = {kind, downS: atS, span};
    event.currentTarget.setPointerCapture(event.pointerId);
    event.stopImmediatePropagation();
  };
  const onMove = (event: JSX.TargetedPointerEvent<HTMLCanvasElement>) => {
    const held = grip.current;
    if (held === null) return;
    event.stopImmediatePropagation();
    const {atS} = timeOf(event);
    const byS = atS - held.downS;
    const {fromS, toS} = held.span;
    if (held.kind === 'move') shared.setSpan({fromS: fromS + byS, toS: toS + byS});
    else if (held.kind === 'from') shared.setSpan({fromS: Math.min(fromS + byS, toS), toS});
    else shared.setSpan({fromS, toS: Math.max(toS + byS, fromS)});
  };
  const onUp = (event: JSX.TargetedPointerEvent<HTMLCanvasElement>) => {
    const held = grip.current;
    if (held === null) return;
    event.stopImmediatePropagation();
    grip.current = null;
    const {atS, perPx} = timeOf(event);
    if (Math.abs(atS - held.downS) < 4 * perPx) shared.pin(atS);
  };
  const isAll = props.progress >= 1;
  return (
    <figure class="review-strip" data-testid="review-strip">
      <canvas
        ref={canvas}
        class="review-strip-plot"
        onPointerDownCapture={onDown}
        onPointerMoveCapture={onMove}
        onPointerUpCapture={onUp}
        onPointerCancelCapture={onUp}
        onKeyDown={onKeyDown}
        {...sliderOf(shared, props.originS, words.strip(props.name))}
      />
      <figcaption>
        {isAll
          ? words.stripText(props.field, lengthText(props.lengthS))
          : words.stripReading(Math.round(100 * props.progress))}
      </figcaption>
    </figure>
  );
}

function paintStrip(canvas: HTMLCanvasElement, props: StripProps): void {
  const begun = beginFrame(canvas);
  if (begun === null) return;
  const {shared, originS} = props;
  const {context} = begun;
  const hasTrials = props.happenings.some((one) => one.kind === 'trial');
  const top = kSymbolPx;
  const frame: Frame = {
    context,
    left: kStripSidePx,
    top,
    width: Math.max(begun.width - 2 * kStripSidePx, 1),
    height: Math.max(begun.height - top - 22 - (hasTrials ? kTrialPx + 2 : 0), 1),
    span: {fromS: shared.whole.fromS + originS, toS: shared.whole.toS + originS},
  };
  const tall = {...frame, height: frame.height + (hasTrials ? kTrialPx + 2 : 0)};
  drawTimes(tall);
  if (props.curve !== null) {
    const range = rangeOf(props.curve, frame.span.fromS, frame.span.toS);
    if (range !== null) drawCurve(frame, props.curve, valueAxis(range.low, range.high, 3), 'quiet');
  }
  if (hasTrials) drawTrials(frame, props.happenings, 0, top + frame.height + 2, kTrialPx);
  const style = getComputedStyle(canvas);
  const onAxis: Frame = {...tall, span: shared.whole};
  const [from, to] = [xOf(onAxis, shared.span.fromS), xOf(onAxis, shared.span.toS)];
  const end = frame.left + frame.width;
  // The parts that do not show below are dimmed.
  context.save();
  context.fillStyle = style.getPropertyValue('--ground');
  context.globalAlpha = 0.66;
  context.fillRect(frame.left, top, Math.max(from - frame.left, 0), tall.height);
  context.fillRect(to, top, Math.max(end - to, 0), tall.height);
  context.restore();
  context.strokeStyle = style.getPropertyValue('--accent');
  context.lineWidth = 1.5;
  context.strokeRect(from, top + 0.5, Math.max(to - from, 2), tall.height - 1);
  context.fillStyle = style.getPropertyValue('--accent');
  for (const x of [from, Math.max(to, from + 2)]) {
    context.fillRect(x - 2.5, top + tall.height / 2 - 11, 5, 22);
  }
  for (const one of props.happenings) {
    if (one.kind === 'trial') continue;
    const x = xOf(frame, one.atS);
    if (x < frame.left - 1 || x > end + 1) continue;
    drawMoment(tall, one.atS, one.kind === 'marker' ? 'accent' : 'quiet', false);
    drawSymbol(context, one.kind, x, top - 9);
  }
  if (shared.brushed !== null) drawBrush(onAxis, shared.brushed);
  if (shared.pinnedS !== null) drawMoment(onAxis, shared.pinnedS, 'text', true);
  if (shared.hoverS !== null) drawMoment(onAxis, shared.hoverS, 'quiet', false);
}

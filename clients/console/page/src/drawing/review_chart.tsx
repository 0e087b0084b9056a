import type {JSX} from 'preact';
import {useRef} from 'preact/hooks';
import {boundsText, linearAxis, withMargin} from '../model/axis';
import {boundsOf, valueAt, type Bounds, type Points} from '../model/points';
import {shortName, type Happening, type ReviewField} from '../model/review';
import {sizedScale, type ShownScale} from '../model/scale';
import {digitsFor, lengthOf, momentText, shifted, type Span} from '../model/span';
import {duration} from '../parts/text';
import {texts} from '../texts/texts';
import {sidesOf, tickMax, type Size} from './canvas';
import {curveColour, isDashed, kPlain, type Line, type Scene} from './scene';
import {TimeChart} from './time_chart';
import {takeKey, underPointer, type Zoom} from './time_gestures';

/** The properties that all charts of a review share. Its times are those of the axis, not of the recording. */
export interface Shared extends Zoom {
  readonly hoverS: number | null;
  readonly brushed: Span | null;
  readonly hover: (atS: number | null) => void;
}

/** The part of the axis around a constant. */
const kSpanMin = 1e-6;
const kSides = sidesOf(1);

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
    onKeyDown: (event: JSX.TargetedKeyboardEvent<HTMLCanvasElement>) => {
      if (takeKey(event, shared)) event.preventDefault();
    },
  };
}

function sizeOf(range: Bounds | null): number {
  return Math.max(Math.abs(range?.low ?? 0), Math.abs(range?.high ?? 0));
}

/** All charts of a review show this alike; its times are the recording's. */
function sceneOf(
  shared: Shared,
  originS: number,
  span: Span,
  {
    range,
    scale,
    lines,
    marks,
    size,
  }: {
    readonly range: Bounds | null;
    readonly scale: ShownScale;
    readonly lines: readonly Line[];
    readonly marks: readonly Happening[];
    readonly size: Size;
  },
): Scene {
  const inRun = (atS: number | null) => (atS === null ? null : atS + originS);
  return {
    ...kPlain,
    span: shifted(span, originS),
    timeText: (timeS, stepS) => momentText(timeS, digitsFor(stepS)),
    axes: [linearAxis(withMargin(range, kSpanMin * sizeOf(range)), scale, tickMax(size))],
    lines,
    marks,
    crossS: inRun(shared.hoverS),
    pinnedS: inRun(shared.pinnedS),
    brush: shared.brushed && shifted(shared.brushed, originS),
  };
}

interface ChartProps {
  readonly shared: Shared;
  /** The recording's time where the axis has 0. */
  readonly originS: number;
  readonly name: string;
  readonly fields: readonly ReviewField[];
  readonly curves: ReadonlyMap<string, Points>;
  /** The bounds of the values, where another chart has the same. */
  readonly range: Bounds | null;
  readonly happenings: readonly Happening[];
  readonly onRemove: (path: string) => void;
}

/** Fields of one unit over time, with their values at the crosshair. */
export function ReviewChart({shared, originS, name, fields, curves, range, ...props}: ChartProps) {
  const words = texts.value.review;
  const scale = sizedScale(fields[0]?.unit ?? '', sizeOf(range));
  const atS = shared.hoverS ?? shared.pinnedS;
  const topics = new Set(fields.map((one) => shortName(one.path).topic));
  const title = [...topics].join(', ');
  const lines = fields.flatMap(({path}, i): Line[] => {
    const points = curves.get(path);
    if (points === undefined) return [];
    return [{points, axis: 0, paint: curveColour(i), isDashed: isDashed(i)}];
  });
  const scene = (size: Size) =>
    sceneOf(shared, originS, shared.span, {range, scale, lines, marks: props.happenings, size});
  return (
    <figure class="review-chart" data-testid="review-chart">
      <figcaption class="chart-head">
        <span class="chart-title">{title}</span>
        {fields.map(({path}, i) => {
          const short = shortName(path);
          const points = curves.get(path);
          const value = atS === null || !points ? null : valueAt(points, atS + originS);
          return (
            <span key={path} class="chart-value review-value">
              <i
                class={isDashed(i) ? 'is-dashed' : ''}
                style={{'--paint': `var(--${curveColour(i)})`}}
              />
              {topics.size > 1 ? `${short.topic} ${short.name}` : short.name}
              <b>{boundsText(value, scale)}</b>
              <button
                type="button"
                class="review-remove"
                aria-label={words.removeField(path)}
                title={words.removeField(path)}
                onClick={() => props.onRemove(path)}
              >
                ×
              </button>
            </span>
          );
        })}
      </figcaption>
      <TimeChart
        scene={scene}
        axis={() => ({view: shared.span, ...kSides, hover: shared.hover, zoom: shared})}
        everyMs={() => 0}
        attributes={{
          class: 'review-plot',
          ...sliderOf(shared, originS, words.chart(`${name} ${title}`)),
        }}
      />
    </figure>
  );
}

interface StripProps {
  readonly shared: Shared;
  readonly originS: number;
  readonly name: string;
  readonly lengthS: number;
  readonly progress: number;
  readonly field: ReviewField | null;
  readonly curve: Points | null;
  readonly happenings: readonly Happening[];
}

const kHandlePx = 10;
const kClickPx = 4;

type Grip = 'from' | 'to' | 'move';

/** A press inside of the window moves it, at an edge it changes that; else a new one is drawn. */
function gripAt({span, whole}: Shared, atS: number, nearS: number): Grip | null {
  if (lengthOf(span) >= 0.999 * lengthOf(whole)) return null;
  if (Math.abs(atS - span.fromS) < nearS) return 'from';
  if (Math.abs(atS - span.toS) < nearS) return 'to';
  return atS > span.fromS && atS < span.toS ? 'move' : null;
}

function pulled(grip: Grip, {fromS, toS}: Span, byS: number): Span {
  if (grip === 'move') return {fromS: fromS + byS, toS: toS + byS};
  return grip === 'from'
    ? {fromS: Math.min(fromS + byS, toS), toS}
    : {fromS, toS: Math.max(toS + byS, fromS)};
}

type StripEvent = JSX.TargetedPointerEvent<HTMLCanvasElement>;

/** The handlers of the window in the strip; what they do not take is a gesture of the whole. */
function useGrip(shared: Shared) {
  const held = useRef<{grip: Grip; downS: number; span: Span} | null>(null);
  const under = (event: StripEvent) =>
    underPointer(event.currentTarget, event.clientX, {view: shared.whole, ...kSides});
  return {
    onPointerDownCapture: (event: StripEvent) => {
      const {atS, perPx} = under(event);
      const grip = gripAt(shared, atS, kHandlePx * perPx);
      if (grip === null) return;
      held.current = {grip, downS: atS, span: shared.span};
      event.currentTarget.setPointerCapture(event.pointerId);
      event.stopImmediatePropagation();
    },
    onPointerMoveCapture: (event: StripEvent) => {
      if (held.current === null) return;
      const {grip, downS, span} = held.current;
      event.stopImmediatePropagation();
      shared.setSpan(pulled(grip, span, under(event).atS - downS));
    },
    onPointerUpCapture: (event: StripEvent) => {
      if (held.current === null) return;
      event.stopImmediatePropagation();
      const {atS, perPx} = under(event);
      if (Math.abs(atS - held.current.downS) < kClickPx * perPx) shared.pin(atS);
      held.current = null;
    },
    onPointerCancelCapture: () => (held.current = null),
  };
}

/** The whole recording at a glance; the part that shows below is a window that can be moved. */
export function OverviewStrip({shared, originS, field, curve, ...props}: StripProps) {
  const words = texts.value.review;
  const {span, whole} = shared;
  const grip = useGrip(shared);
  const range = curve && boundsOf(curve, whole.fromS + originS, whole.toS + originS);
  const scale = sizedScale(field?.unit ?? '', sizeOf(range));
  const lines = curve === null ? [] : [{points: curve, axis: 0, paint: 'quiet'}];
  const scene = (size: Size) => ({
    ...sceneOf(shared, originS, whole, {range, scale, lines, marks: props.happenings, size}),
    window: shifted(span, originS),
  });
  return (
    <figure class="review-strip" data-testid="review-strip">
      <TimeChart
        scene={scene}
        axis={() => ({view: whole, ...kSides, hover: shared.hover, zoom: shared})}
        everyMs={() => 0}
        attributes={{
          class: 'review-strip-plot',
          ...grip,
          ...sliderOf(shared, originS, words.strip(props.name)),
        }}
      />
      <figcaption>
        {props.progress >= 1
          ? words.stripText(field?.path ?? '', duration(props.lengthS))
          : words.stripReading(Math.round(100 * props.progress))}
      </figcaption>
    </figure>
  );
}

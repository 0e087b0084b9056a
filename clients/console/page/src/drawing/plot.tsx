import {useSignal, type ReadonlySignal} from '@preact/signals';
import type {JSX} from 'preact';
import {useRef} from 'preact/hooks';
import {boundsText, linearAxis, withMargin, type ValueAxis} from '../model/axis';
import {subjectOf} from '../model/fields';
import type {Plot} from '../model/layout';
import {binned, boundsOf, boundsOfAll, valueAt, type Points} from '../model/points';
import {sizedScale, type ShownScale, type SizedScale} from '../model/scale';
import {clockText, digitsFor, lengthOf, type Span} from '../model/span';
import {kStaleMs} from '../model/state';
import {fixed} from '../parts/text';
import type {MarkerList} from '../store/markers';
import type {Field, PlotData} from '../store/plot_data';
import type {TimeView} from '../store/plots';
import {texts} from '../texts/texts';
import {sidesOf, tickMax, type Size} from './canvas';
import {marksOf} from './marks';
import {curveColour, isDashed, kPlain, type Limit, type Line, type Scene} from './scene';
import {TimeChart} from './time_chart';
import {takeKey, type Zoom} from './time_gestures';

const kPaintMinMs = 50;
const kPaintMaxMs = 1000;
const kColumnMax = 2000;
/** Noise of a constant value does not fill the plot. */
const kSpanMin = 0.02;
const kNothing: Points = {times: [], low: [], high: []};

interface Props {
  readonly plot: Plot;
  readonly title: string;
  readonly data: PlotData;
  readonly view: TimeView;
  readonly nowMs: () => number;
  readonly isLive: () => boolean;
  readonly markers: () => MarkerList;
  readonly onRemove: (path: string) => void;
}

/** A row of the table. */
interface Shown {
  readonly value: string;
  readonly low: string;
  readonly high: string;
}

const kNoValues: Shown = {value: '–', low: '–', high: '–'};

/** One plot: its curves, axes and crosshair, and its values as a table. */
export function PlotChart(props: Props) {
  const {plot, data, view} = props;
  const rows = useSignal<readonly Shown[]>([]);
  const alarm = useSignal('');
  const scales = useRef(new Map<string, SizedScale>());
  const [crossS, brush] = [view.crosshairS.value, view.brush.value];
  const isFollowing = view.fixed.value === null;
  const fieldsNow = () => plot.fields.map((path) => data.field(path));
  const scene = (size: Size): Scene => {
    const fields = fieldsNow();
    const shown = {...sceneOf(props, fields, size, scales.current), crossS, brush};
    rows.value = fields.map((field, i) => rowOf(props, field, shown, i, isFollowing));
    alarm.value = passedOf(props, fields, shown).join(' · ');
    return shown;
  };
  const axis = () => ({
    ...{view: view.span, ...sidesOf(unitsOf(fieldsNow()).length), zoom: zoomOf(view)},
    hover: (atS: number | null) => (view.crosshairS.value = atS),
  });
  const onKeyDown = (event: JSX.TargetedKeyboardEvent<HTMLDivElement>) => {
    if (event.key === ' ' && isFollowing) view.pause();
    else if (event.key === ' ') view.follow();
    else if (!takeKey(event, zoomOf(view))) return;
    event.preventDefault();
  };
  return (
    <>
      <Alarm alarm={alarm} />
      <div
        class="plot-canvas"
        tabIndex={0}
        role="img"
        aria-label={texts.value.plots.canvas(props.title)}
        onKeyDown={onKeyDown}
        data-testid="plot-canvas"
      >
        <TimeChart
          scene={scene}
          axis={axis}
          everyMs={() => Math.min(kPaintMaxMs, Math.max(kPaintMinMs, lengthOf(view.span) / 2))}
          attributes={{}}
        />
      </div>
      <Legend {...props} rows={rows} />
    </>
  );
}

function zoomOf(view: TimeView): Zoom {
  return {
    span: view.span,
    whole: view.whole,
    pinnedS: view.crosshairS.peek(),
    setSpan: (span) => view.show(span),
    reset: () => {
      view.crosshairS.value = null;
      view.follow();
    },
    pin: (atS) => (view.crosshairS.value = atS),
    brush: (span) => (view.brush.value = span),
  };
}

/** Curves of one unit have one axis: left, right, left … */
function unitsOf(fields: readonly (Field | null)[]): string[] {
  return [...new Set(fields.map((field) => field?.unit ?? ''))];
}

function sceneOf(
  {plot, view, markers}: Props,
  fields: readonly (Field | null)[],
  size: Size,
  scales: Map<string, SizedScale>,
): Omit<Scene, 'crossS'> {
  const {span} = view;
  const units = unitsOf(fields);
  const count = Math.min(kColumnMax, Math.max(50, size.width));
  const lines = fields.map((field, i) => ({
    points: field === null ? kNothing : binned(field, span.fromS, span.toS, count),
    axis: units.indexOf(field?.unit ?? ''),
    paint: curveColour(i),
    isDashed: isDashed(i),
  }));
  const axes = units.map((unit, i) => {
    const range = rangeOf(
      plot,
      unit,
      lines.filter((line) => line.axis === i),
      span,
    );
    const scale = sizedScale(unit, Math.max(-range.low, range.high), scales.get(unit));
    scales.set(unit, scale);
    return linearAxis(range, scale, tickMax(size));
  });
  return {
    ...kPlain,
    span,
    timeText: (timeS, stepS) => clockText(timeS, digitsFor(stepS), stepS < 60),
    axes,
    lines,
    limits: limitsOf(plot, units, axes),
    marks: marksOf(markers(), 0, span),
  };
}

function rangeOf({thresholds}: Plot, unit: string, lines: readonly Line[], span: Span) {
  const limits = thresholds
    .filter((one) => one.unit === unit)
    .map(({value}) => ({low: value, high: value}));
  const curves = lines.map(({points}) => boundsOf(points, span.fromS, span.toS));
  const all = boundsOfAll([...curves, ...limits]);
  return withMargin(all, kSpanMin * Math.max(Math.abs(all?.low ?? 0), Math.abs(all?.high ?? 0)));
}

function limitsOf({thresholds}: Plot, units: readonly string[], axes: readonly ValueAxis[]) {
  return thresholds.flatMap(({unit, value, label}): Limit[] => {
    const axis = units.indexOf(unit);
    const scale = axes[axis]?.scale;
    if (scale === undefined) return [];
    return [{axis, value, label: label === '' ? numberText(value, scale) : label.slice(0, 40)}];
  });
}

function numberText(value: number, {factor, digits}: ShownScale): string {
  return fixed(value * factor, digits);
}

function isFresh({isLive, nowMs}: Props, field: Field): boolean {
  return isLive() && nowMs() - field.cameMs <= kStaleMs;
}

/** The values at the crosshair, else the newest. */
function rowOf(
  props: Props,
  field: Field | null,
  {lines, axes, crossS, span}: Scene,
  at: number,
  isFollowing: boolean,
): Shown {
  const line = lines[at];
  const scale = axes[line?.axis ?? -1]?.scale;
  if (field === null || line === undefined || scale === undefined) return kNoValues;
  const isNow = crossS === null && isFollowing;
  const newest = field.ring.valueAt(field.ring.size - 1);
  const value =
    isNow && isFresh(props, field)
      ? {low: newest, high: newest}
      : // An old value is not shown as if it were new.
        isNow && field.ring.size > 0
        ? null
        : valueAt(line.points, crossS ?? span.toS);
  const bounds = boundsOf(line.points, span.fromS, span.toS);
  return {
    value: value === null ? '–' : `${boundsText(value, scale)} ${scale.unit}`,
    low: bounds === null ? '–' : numberText(bounds.low, scale),
    high: bounds === null ? '–' : numberText(bounds.high, scale),
  };
}

/** The thresholds that newest values pass, in words. */
function passedOf(
  props: Props,
  fields: readonly (Field | null)[],
  {lines, axes}: Omit<Scene, 'crossS'>,
): string[] {
  const words = texts.peek().plots;
  return fields.flatMap((field, i) => {
    const scale = axes[lines[i]?.axis ?? 0]?.scale;
    if (field === null || scale === undefined || !isFresh(props, field)) return [];
    const newest = field.ring.valueAt(field.ring.size - 1);
    return props.plot.thresholds
      .filter(({unit}) => unit === field.unit)
      .filter(({side, value}) => (side === 'above' ? newest > value : newest < value))
      .map(({side, value, label}) => {
        const limit = `${numberText(value, scale)} ${scale.unit}`;
        const name = label === '' ? limit : `${label} (${limit})`;
        return words[side === 'above' ? 'isAbove' : 'isBelow'](field.path, name);
      });
  });
}

function Alarm({alarm}: {alarm: ReadonlySignal<string>}) {
  return (
    <p class="plot-alarms" role="status" hidden={alarm.value === ''}>
      {alarm.value === '' ? '' : `⚠ ${alarm.value}`}
    </p>
  );
}

interface LegendProps extends Props {
  readonly rows: ReadonlySignal<readonly Shown[]>;
}

function Legend({plot, title, onRemove, rows}: LegendProps) {
  const words = texts.value.plots;
  return (
    <div class="scroll">
      <table class="plot-legend">
        <caption class="visually-hidden">{words.legend(title)}</caption>
        <thead>
          <tr>
            <th scope="col">{words.curve}</th>
            {[words.value, words.lowest, words.highest].map((name) => (
              <th key={name} scope="col" class="number">
                {name}
              </th>
            ))}
            <th scope="col">
              <span class="visually-hidden">{words.remove}</span>
            </th>
          </tr>
        </thead>
        <tbody>
          {plot.fields.map((path, i) => (
            <tr key={path} data-curve={path}>
              <th scope="row">
                <i
                  class={isDashed(i) ? 'is-dashed' : ''}
                  style={{'--paint': `var(--${curveColour(i)})`}}
                />
                <span class="quiet">{subjectOf(path)} </span>
                {path.slice(subjectOf(path).length + 1)}
              </th>
              <td class="number" data-value>
                {rows.value[i]?.value}
              </td>
              <td class="number" data-low>
                {rows.value[i]?.low}
              </td>
              <td class="number" data-high>
                {rows.value[i]?.high}
              </td>
              <td class="number">
                <button
                  type="button"
                  class="quiet-button"
                  aria-label={words.removeCurve(path)}
                  onClick={() => onRemove(path)}
                >
                  ×
                </button>
              </td>
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}

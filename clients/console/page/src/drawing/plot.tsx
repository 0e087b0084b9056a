import {useSignal} from '@preact/signals';
import type {JSX} from 'preact';
import {useRef} from 'preact/hooks';
import {linearAxis, numberText, withMargin, type ValueAxis} from '../model/axis';
import type {Plot} from '../model/layout';
import {binned, boundsOf, boundsOfAll, type Points} from '../model/points';
import {sizedScale, type SizedScale} from '../model/scale';
import {clockText, digitsFor, lengthOf, type Span} from '../model/span';
import type {MarkerList} from '../store/markers';
import type {Field, PlotData} from '../store/plot_data';
import type {TimeView} from '../store/plots';
import {texts} from '../texts/texts';
import {sidesOf, tickMax, type Size} from './canvas';
import {marksOf} from './marks';
import {Alarm, Legend, passedOf, rowOf, type LegendProps, type Row} from './plot_legend';
import {curveColour, isDashed, kPlain, type Limit, type Line, type Scene} from './scene';
import {TimeChart} from './time_chart';
import {takeKey, type Zoom} from './time_gestures';

const kPaintMinMs = 50;
const kPaintMaxMs = 1000;
const kColumnMax = 2000;
/** Noise of a constant value does not fill the plot. */
const kSpanMin = 0.02;
const kNothing: Points = {times: [], ends: [], low: [], high: []};

interface Props extends LegendProps {
  readonly data: PlotData;
  readonly view: TimeView;
  readonly markers: () => MarkerList;
}

/** One plot: its curves, axes and crosshair, and its values as a table. */
export function PlotChart(props: Props) {
  const {plot, data, view} = props;
  const rows = useSignal<readonly Row[]>([]);
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
    ...sidesOf(unitsOf(fieldsNow()).length),
    view: view.span,
    zoom: zoomOf(view),
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

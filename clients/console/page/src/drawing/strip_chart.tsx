import {signal, useSignal, type ReadonlySignal} from '@preact/signals';
import {boundsText, decadeAxis, linearAxis, withMargin} from '../model/axis';
import {binned, boundsOf, boundsOfAll, kNoPast, valueAt} from '../model/points';
import type {ShownScale} from '../model/scale';
import {digitsFor} from '../model/span';
import {fixed} from '../parts/text';
import type {MarkerList} from '../store/markers';
import type {Series} from '../store/series';
import {texts} from '../texts/texts';
import {sidesOf, tickMax, type Size} from './canvas';
import {marksOf} from './marks';
import {kPlain, type Scene} from './scene';
import {TimeChart} from './time_chart';
import type {TimeAxis} from './time_gestures';

export interface Curve {
  readonly column: number;
  readonly label: string;
  /** A colour's name in the style sheet. */
  readonly paint: string;
}

export interface ChartSource {
  readonly series: Series;
  readonly endS: number;
  /** The series' clock minus that of markers. */
  readonly offsetS?: number;
  /** The newest row is recent. */
  readonly isFresh: boolean;
}

interface Props {
  /** For tests, in every language. */
  readonly name: string;
  readonly title: string;
  readonly scale: ShownScale;
  readonly curves: readonly Curve[];
  readonly windowS: number;
  /** At least so much shows, in the shown unit, so that noise does not fill the chart. */
  readonly spanMin: number;
  readonly isLogarithmic?: boolean;
  readonly markers: () => MarkerList;
  readonly gapS: number;
  readonly source: () => ChartSource | null;
}

const kPaintMs = 50;
const kPointMax = 900;

/** The crosshair of all strips, in seconds after their end: 0 or less. */
const crossS = signal<number | null>(null);

function secondsText(seconds: number, stepS: number): string {
  const digits = digitsFor(stepS);
  const shown = Number(seconds.toFixed(digits));
  if (shown === 0) return texts.peek().live.now;
  return shown <= -120 && digits === 0
    ? `${fixed(shown / 60, shown % 60 === 0 ? 0 : 1)} min`
    : `${fixed(shown, digits)} s`;
}

/** Curves over the last seconds, with their values at the crosshair, else the newest. */
export function StripChart(props: Props) {
  const {title, curves, windowS} = props;
  const values = useSignal<readonly string[]>([]);
  const isStale = useSignal(true);
  const atS = crossS.value;
  const scene = (size: Size) => {
    const source = props.source();
    isStale.value = source === null || !source.isFresh;
    const shown = source === null ? null : sceneOf(props, source, size, atS);
    values.value = source === null || shown === null ? [] : valuesOf(props, source, shown);
    return shown;
  };
  const axis = (): TimeAxis | null => {
    const endS = props.source()?.endS;
    if (endS === undefined) return null;
    const hover = (toS: number | null) => (crossS.value = toS === null ? null : toS - endS);
    return {view: {fromS: endS - windowS, toS: endS}, ...sidesOf(1), hover, zoom: null};
  };
  const label = texts.value.live.chart(title, windowS);
  return (
    <figure
      class={`strip ${isStale.value ? 'is-stale' : ''}`}
      data-testid={`strip-${props.name.toLowerCase()}`}
    >
      <figcaption class="chart-head">
        <span class="chart-title">{title}</span>
        <Values curves={curves} values={values} />
      </figcaption>
      <TimeChart
        scene={scene}
        axis={axis}
        everyMs={() => kPaintMs}
        attributes={{class: 'strip-plot', role: 'img', 'aria-label': label}}
      />
      <p class="strip-stale">{texts.value.live.notLive}</p>
    </figure>
  );
}

function Values(props: {curves: readonly Curve[]; values: ReadonlySignal<readonly string[]>}) {
  return (
    <div class="chart-values">
      {props.curves.map(({label, paint}, i) => (
        <span key={label} class="chart-value">
          <i style={{'--paint': `var(--${paint})`}} />
          {label} <b>{props.values.value[i] ?? '–'}</b>
        </span>
      ))}
    </div>
  );
}

function sceneOf(props: Props, source: ChartSource, size: Size, crossAtS: number | null): Scene {
  const {series, endS, offsetS = 0} = source;
  const span = {fromS: endS - props.windowS, toS: endS};
  const lines = props.curves.map(({column, paint}) => {
    const curve = {ring: series.column(column), past: kNoPast};
    const points = binned(curve, span.fromS, endS, kPointMax, props.gapS);
    return {points, axis: 0, paint};
  });
  const bounds = boundsOfAll(lines.map(({points}) => boundsOf(points, span.fromS, span.toS)));
  const {scale, spanMin} = props;
  const axis = props.isLogarithmic
    ? decadeAxis(bounds, scale)
    : linearAxis(withMargin(bounds, spanMin / scale.factor), scale, tickMax(size));
  return {
    ...kPlain,
    span,
    zeroS: endS,
    timeText: (timeS, stepS) => secondsText(timeS - endS, stepS),
    axes: [axis],
    lines,
    marks: marksOf(props.markers(), offsetS, span),
    crossS: crossAtS === null ? null : endS + crossAtS,
  };
}

function valuesOf({curves, scale}: Props, source: ChartSource, scene: Scene): string[] {
  const {series, isFresh} = source;
  return curves.map(({column}, i) => {
    const points = scene.lines[i]?.points;
    const newest = isFresh ? series.valueAt(series.size - 1, column) : NaN;
    if (scene.crossS === null || points === undefined)
      return boundsText({low: newest, high: newest}, scale);
    return boundsText(valueAt(points, scene.crossS), scale);
  });
}

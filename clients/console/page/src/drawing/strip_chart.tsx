import {useEffect, useRef} from 'preact/hooks';
import uPlot from 'uplot';
import {fixed} from '../parts/text';
import {eachFrame} from '../store/frames';
import type {MarkerList} from '../store/markers';
import type {Series} from '../store/series';
import {colour, themeVersion} from '../store/theme';
import {texts} from '../texts/texts';
import {drawMarkers, drawTrials} from './experiment';

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
  name: string;
  title: string;
  unit: string;
  /** From the series' unit to the shown one. */
  factor: number;
  digits: number;
  curves: readonly Curve[];
  windowS: number;
  /** At least so much of y shows, so that noise does not fill the chart. */
  spanMin: number;
  isLogarithmic?: boolean;
  /** Drawn as lines with labels; trials as bands. */
  markers?: () => MarkerList;
  gapS: number;
  source: () => ChartSource | null;
}

const kPaintMs = 50;
const kPointMax = 900;

type Range = [number, number];

function rangeOf(low: number | null, high: number | null, spanMin: number): Range {
  const from = low ?? 0;
  const to = high ?? 0;
  const margin = Math.max(0.08 * (to - from), (spanMin - (to - from)) / 2, 0);
  return [from - margin, to + margin];
}

function optionsOf(
  props: Props,
  present: {nowS: number},
  width: number,
  height: number,
): uPlot.Options {
  const axis = {
    stroke: colour('quiet'),
    font: '12px system-ui, sans-serif',
    grid: {stroke: colour('line'), width: 1},
    ticks: {show: false},
  };
  const isLogarithmic = props.isLogarithmic ?? false;
  return {
    width,
    height,
    legend: {show: false},
    cursor: {show: false},
    padding: [8, 12, 0, 0],
    scales: {
      x: {time: false, auto: false, range: () => [-props.windowS, 0] as Range},
      y: isLogarithmic
        ? {
            distr: 3,
            range: (_, low, high) => [Math.min(10, low ?? 10), Math.max(2000, high ?? 0)] as Range,
          }
        : {range: (_, low, high) => rangeOf(low, high, props.spanMin)},
    },
    axes: [
      {...axis, size: 24, values: (_, ticks) => ticks.map((tick) => secondsText(tick))},
      {...axis, size: 52, ...(isLogarithmic ? decades(axis.grid) : {space: 28})},
    ],
    series: [
      {},
      ...props.curves.map((curve) => ({
        stroke: colour(curve.paint),
        width: 1.75,
        spanGaps: false,
        points: {show: false},
      })),
    ],
    hooks: {
      drawClear: [(chart) => drawTrials(chart, props.markers?.(), present.nowS)],
      draw: [(chart) => drawMarkers(chart, props.markers?.(), present.nowS)],
    },
  };
}

/** Of a logarithmic axis of microseconds: lines and words at powers of ten only. */
function decades(grid: uPlot.Axis.Grid): uPlot.Axis {
  const filter = (_: uPlot, ticks: number[]) =>
    ticks.map((tick) => (Number.isInteger(Math.log10(tick)) ? tick : null));
  const values = (_: uPlot, ticks: (number | null)[]) =>
    ticks.map((tick) =>
      tick === null
        ? ''
        : tick < 1e3
          ? `${tick} µs`
          : tick < 1e6
            ? `${tick / 1e3} ms`
            : `${tick / 1e6} s`,
    );
  return {filter, values, grid: {...grid, filter}};
}

function secondsText(seconds: number): string {
  if (seconds === 0) return texts.value.live.now;
  return seconds <= -120 ? `${Math.round(seconds / 6) / 10} min` : `${seconds} s`;
}

/** Curves over the last seconds, with their newest values. */
export function StripChart(props: Props) {
  const holder = useRef<HTMLDivElement>(null);
  const values = useRef<HTMLDivElement>(null);
  const figure = useRef<HTMLElement>(null);
  const latest = useRef(props);
  latest.current = props;
  const version = themeVersion.value;
  const key = props.curves.map((curve) => curve.label).join();

  useEffect(() => {
    const target = holder.current;
    if (target === null) return undefined;
    const empty: uPlot.AlignedData = [[], ...props.curves.map(() => [])];
    const present: {nowS: number} = {nowS: NaN};
    const chart = new uPlot(
      optionsOf(props, present, target.clientWidth, target.clientHeight),
      empty,
      target,
    );
    const observer = new ResizeObserver(() =>
      chart.setSize({width: target.clientWidth, height: target.clientHeight}),
    );
    observer.observe(target);
    let lastMs = 0;
    const stop = eachFrame((nowMs) => {
      if (nowMs - lastMs < kPaintMs) return;
      lastMs = nowMs;
      paint(chart, latest.current, present, values.current, figure.current);
    });
    return () => {
      stop();
      observer.disconnect();
      chart.destroy();
    };
  }, [version, props.windowS, key]);

  return (
    <figure ref={figure} class="strip" data-testid={`strip-${props.name.toLowerCase()}`}>
      <figcaption class="strip-head">
        <span class="strip-title">
          {props.title} <span class="unit">{props.unit}</span>
        </span>
        <div ref={values} class="strip-values">
          {props.curves.map((curve) => (
            <span key={curve.label} class="strip-value">
              <i style={{background: `var(--${curve.paint})`}} />
              {curve.label} <b>–</b>
            </span>
          ))}
        </div>
      </figcaption>
      <div
        ref={holder}
        class="strip-plot"
        role="img"
        aria-label={texts.value.live.chart(props.title, props.windowS)}
      />
      <p class="strip-stale">{texts.value.live.notLive}</p>
    </figure>
  );
}

function paint(
  chart: uPlot,
  props: Props,
  present: {nowS: number},
  values: HTMLElement | null,
  figure: HTMLElement | null,
): void {
  const source = props.source();
  figure?.classList.toggle('is-stale', source === null || !source.isFresh);
  if (source === null) {
    chart.setData([[], ...props.curves.map(() => [])]);
    return;
  }
  present.nowS = source.endS - (source.offsetS ?? 0);
  const picked = props.curves.map((curve) => curve.column);
  const columns = source.series.window(source.endS, props.windowS, picked, kPointMax, props.gapS);
  if (props.factor !== 1) {
    for (const column of columns.slice(1) as (number | null)[][]) {
      column.forEach((value, i) => (column[i] = value === null ? null : value * props.factor));
    }
  }
  chart.setData(columns);
  const last = source.series.size - 1;
  values?.querySelectorAll('b').forEach((cell, i) => {
    const value = source.isFresh ? source.series.valueAt(last, picked[i] ?? 0) : NaN;
    cell.textContent = fixed(value * props.factor, props.digits);
  });
}

import {useEffect, useRef} from 'preact/hooks';
import type {JSX} from 'preact';
import uPlot from 'uplot';
import {bin, valuesAt, type Binned} from '../model/bins';
import {subjectOf} from '../model/fields';
import type {Plot, Threshold} from '../model/layout';
import {prefixFor, shownAngle} from '../model/scale';
import {kStaleMs} from '../model/state';
import {fixed} from '../parts/text';
import {eachFrame} from '../store/frames';
import type {MarkerList} from '../store/markers';
import type {Field, PlotData} from '../store/plot_data';
import type {TimeView} from '../store/plots';
import {angle, mark} from '../store/settings';
import {colour, themeVersion} from '../store/theme';
import {texts} from '../texts/texts';
import {drawMarkers, drawTrials} from './experiment';

const kPaintMinMs = 50;
const kColumnMax = 1000;
const kColourCount = 8;
const kAxisPx = 58;
/** Pointers that move less have clicked. */
const kDragMinPx = 5;
const kZoomStep = 0.8;
const kPanStep = 0.1;
const kCrossStep = 0.01;

interface Props {
  plot: Plot;
  title: string;
  data: PlotData;
  view: TimeView;
  nowMs: () => number;
  isLive: () => boolean;
  markers: () => MarkerList;
  onRemove: (path: string) => void;
}

/** Curves of one unit have one axis: left, right, left … */
interface Axis {
  /** As measured. */
  readonly unit: string;
  /** From it to the angle that is shown. */
  readonly factor: number;
  readonly shownUnit: string;
  /** By the newest range that was drawn. */
  prefix: {prefix: string; factor: number};
  /** Decimals of a number in the legend. */
  digits: number;
}

/** The name of the colour of a curve, by its place. */
export function curveColour(index: number): string {
  return `curve-${1 + (index % kColourCount)}`;
}

/** With more curves than colours, they are dashed. */
export function isDashed(index: number): boolean {
  return index >= kColourCount;
}

function clockText(seconds: number, stepS: number): string {
  const date = new Date(1000 * seconds);
  const two = (value: number) => String(value).padStart(2, '0');
  const minute = `${two(date.getHours())}:${two(date.getMinutes())}`;
  if (stepS >= 60) return minute;
  const digits = Math.min(3, Math.max(0, Math.ceil(-Math.log10(stepS))));
  const fraction = digits === 0 ? '' : String(date.getMilliseconds()).padStart(3, '0');
  const point = digits === 0 ? '' : mark.peek() === 'comma' ? ',' : '.';
  return `${minute}:${two(date.getSeconds())}${point}${fraction.slice(0, digits)}`;
}

function axesOf(fields: readonly (Field | null)[]): Axis[] {
  const axes: Axis[] = [];
  for (const field of fields) {
    const unit = field?.unit ?? '';
    if (axes.some((axis) => axis.unit === unit)) continue;
    const {unit: shown, factor} = shownAngle(unit);
    const shownUnit = shown === '1' ? '' : shown;
    axes.push({unit, factor, shownUnit, prefix: {prefix: '', factor: 1}, digits: 3});
  }
  return axes;
}

/** Changes the prefix only where the old one does not fit any more, so that it does not flicker. */
function choosePrefix(axis: Axis, size: number): void {
  const shown = size * axis.prefix.factor;
  if (shown < 0.5 || shown >= 1500) axis.prefix = prefixFor(size, axis.shownUnit);
  const scaled = Math.max(size * axis.prefix.factor, 1e-12);
  axis.digits = Math.min(4, Math.max(0, 3 - Math.floor(Math.log10(scaled))));
}

function shownNumber(axis: Axis, value: number): string {
  return fixed(value * axis.factor * axis.prefix.factor, axis.digits);
}

function unitText(axis: Axis): string {
  return `${axis.prefix.prefix}${axis.shownUnit}`;
}

function rangeOf(
  axis: Axis,
  thresholds: readonly Threshold[],
  low: number | null,
  high: number | null,
): [number, number] {
  const lines = thresholds
    .filter((one) => one.unit === axis.unit)
    .map((one) => one.value * axis.factor);
  const from = Math.min(low ?? 0, ...lines);
  const to = Math.max(high ?? 0, ...lines);
  // Noise of a constant value does not fill the plot.
  const span = Math.max(to - from, 0.02 * Math.max(Math.abs(from), Math.abs(to)), 1e-9);
  const margin = 0.08 * span + (span - (to - from)) / 2;
  return [from - margin, to + margin];
}

interface Chart {
  readonly chart: uPlot;
  readonly axes: readonly Axis[];
  readonly axisOf: readonly number[];
  binned: Binned | null;
}

function optionsOf(props: Props, axes: readonly Axis[], axisOf: readonly number[]): uPlot.Options {
  const common = {
    stroke: colour('quiet'),
    font: '12px system-ui, sans-serif',
    ticks: {show: false},
  };
  const scales: uPlot.Scales = {
    x: {time: true, auto: false, range: () => [...props.view.range()] as [number, number]},
  };
  axes.forEach((axis, i) => {
    scales[`y${i}`] = {
      range: (_, low, high) => {
        const range = rangeOf(axis, props.plot.thresholds, low, high);
        choosePrefix(axis, Math.max(Math.abs(range[0]), Math.abs(range[1])));
        return range;
      },
    };
  });
  return {
    width: 300,
    height: 200,
    legend: {show: false},
    cursor: {show: false},
    padding: [30, 12, 0, 4],
    scales,
    axes: [
      {
        ...common,
        size: 26,
        grid: {stroke: colour('line'), width: 1},
        values: (_, ticks, __, ___, stepS) => ticks.map((tick) => clockText(tick, stepS)),
      },
      ...axes.map((axis, i): uPlot.Axis => ({
        ...common,
        scale: `y${i}`,
        side: i % 2 === 0 ? 3 : 1,
        size: kAxisPx,
        space: 28,
        grid: {show: i === 0, stroke: colour('line'), width: 1},
        values: (_, ticks, __, ___, step) => {
          const digits = Math.ceil(-Math.log10(step * axis.prefix.factor) - 1e-9);
          return ticks.map((tick) =>
            fixed(tick * axis.prefix.factor, Math.min(6, Math.max(0, digits))),
          );
        },
      })),
    ],
    series: [
      {},
      ...props.plot.fields.map((_, i) => ({
        scale: `y${axisOf[i] ?? 0}`,
        stroke: colour(curveColour(i)),
        width: 1.75,
        ...(isDashed(i) ? {dash: [6, 4]} : {}),
        spanGaps: false,
        points: {show: false},
      })),
    ],
    hooks: {
      drawClear: [(chart) => drawTrials(chart, props.markers(), 0)],
      draw: [
        (chart) => drawUnits(chart, axes),
        (chart) => drawThresholds(chart, props.plot.thresholds, axes),
        (chart) => drawMarkers(chart, props.markers(), 0),
      ],
    },
  };
}

/** The unit of each axis stands above it. */
function drawUnits(chart: uPlot, axes: readonly Axis[]): void {
  const {left, top, width} = chart.bbox;
  const {ctx: context} = chart;
  const ratio = devicePixelRatio;
  context.save();
  context.fillStyle = colour('text');
  context.font = `600 ${12 * ratio}px system-ui, sans-serif`;
  context.textBaseline = 'bottom';
  axes.forEach((axis, i) => {
    const out = Math.floor(i / 2) * kAxisPx * ratio;
    const isLeft = i % 2 === 0;
    context.textAlign = isLeft ? 'right' : 'left';
    const x = isLeft ? left - out - 6 * ratio : left + width + out + 6 * ratio;
    context.fillText(unitText(axis), x, top - 10 * ratio);
  });
  context.restore();
}

function drawThresholds(
  chart: uPlot,
  thresholds: readonly Threshold[],
  axes: readonly Axis[],
): void {
  const {left, top, width, height} = chart.bbox;
  const {ctx: context} = chart;
  const ratio = devicePixelRatio;
  context.save();
  context.font = `${12 * ratio}px system-ui, sans-serif`;
  context.textAlign = 'right';
  context.textBaseline = 'bottom';
  context.lineWidth = 1.5 * ratio;
  for (const threshold of thresholds) {
    const at = axes.findIndex((axis) => axis.unit === threshold.unit);
    const axis = axes[at];
    if (axis === undefined) continue;
    const y = chart.valToPos(threshold.value * axis.factor, `y${at}`, true);
    if (!(y >= top && y <= top + height)) continue;
    context.strokeStyle = context.fillStyle = colour('bad');
    context.setLineDash([6 * ratio, 4 * ratio]);
    context.beginPath();
    context.moveTo(left, y);
    context.lineTo(left + width, y);
    context.stroke();
    const label = threshold.label === '' ? shownNumber(axis, threshold.value) : threshold.label;
    context.fillText(label.slice(0, 40), left + width - 6 * ratio, y - 2 * ratio);
  }
  context.restore();
}

/** One plot: its curves, axes and crosshair, and its values as a table. */
export function PlotChart(props: Props) {
  const holder = useRef<HTMLDivElement>(null);
  const legend = useRef<HTMLTableSectionElement>(null);
  const alarms = useRef<HTMLParagraphElement>(null);
  const made = useRef<Chart | null>(null);
  const latest = useRef(props);
  latest.current = props;
  const {plot, data} = props;
  const words = texts.value.plots;
  const fields = plot.fields.map((path) => data.field(path));
  const axes = axesOf(fields);
  // A change of these takes another chart; the rest is painted.
  const key = JSON.stringify([
    ...[plot.fields, axes.map((axis) => axis.unit), plot.thresholds],
    ...[themeVersion.value, angle.value, data.version.value],
  ]);

  useEffect(() => {
    const target = holder.current;
    if (target === null) return undefined;
    const axisOf = fields.map((field) =>
      axes.findIndex((axis) => axis.unit === (field?.unit ?? '')),
    );
    const empty: uPlot.AlignedData = [[], ...plot.fields.map(() => [])];
    const chart = new uPlot(optionsOf(props, axes, axisOf), empty, target);
    const one: Chart = {chart, axes, axisOf, binned: null};
    made.current = one;
    const resize = () => chart.setSize({width: target.clientWidth, height: target.clientHeight});
    const observer = new ResizeObserver(resize);
    observer.observe(target);
    resize();
    const pointer = new Pointer(chart, props.view);
    let lastMs = 0;
    const stop = eachFrame((nowMs) => {
      const [beginS, endS] = props.view.range();
      pointer.paint(beginS, endS);
      // A column of the range passes in this time.
      const columnMs = (1000 * (endS - beginS)) / Math.max(1, chart.over.clientWidth);
      if (nowMs - lastMs < Math.min(1000, Math.max(kPaintMinMs, columnMs / 2)) && !pointer.moved)
        return;
      lastMs = nowMs;
      pointer.moved = false;
      paint(one, latest.current, beginS, endS);
      writeLegend(one, latest.current, legend.current, alarms.current);
    });
    return () => {
      stop();
      pointer.end();
      observer.disconnect();
      chart.destroy();
      made.current = null;
    };
  }, [key]);

  const onKeyDown = (event: JSX.TargetedKeyboardEvent<HTMLDivElement>) => {
    const {view} = props;
    const [beginS, endS] = view.range();
    const span = endS - beginS;
    const cross = (by: number) => {
      const at = view.crosshairS.peek() ?? endS;
      view.crosshairS.value = Math.min(endS, Math.max(beginS, at + by * span));
    };
    const actions: Readonly<Record<string, () => void>> = {
      ArrowLeft: () => (event.shiftKey ? view.pan(-kPanStep * span) : cross(-kCrossStep)),
      ArrowRight: () => (event.shiftKey ? view.pan(kPanStep * span) : cross(kCrossStep)),
      '+': () => view.zoom(kZoomStep, view.crosshairS.peek() ?? undefined),
      '-': () => view.zoom(1 / kZoomStep, view.crosshairS.peek() ?? undefined),
      ' ': () => (view.fixed.peek() === null ? view.pause() : view.follow()),
      Escape: () => {
        view.crosshairS.value = null;
        view.follow();
      },
    };
    const act = actions[event.key];
    if (act === undefined || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    act();
  };

  return (
    <>
      <p ref={alarms} class="plot-alarms" role="status" hidden />
      <div
        ref={holder}
        class="plot-canvas"
        tabIndex={0}
        role="img"
        aria-label={words.canvas(props.title)}
        onKeyDown={onKeyDown}
        data-testid="plot-canvas"
      />
      <div class="scroll">
        <table class="plot-legend">
          <caption class="visually-hidden">{words.legend(props.title)}</caption>
          <thead>
            <tr>
              <th scope="col">{words.curve}</th>
              <th scope="col" class="number">
                {words.value}
              </th>
              <th scope="col" class="number">
                {words.lowest}
              </th>
              <th scope="col" class="number">
                {words.highest}
              </th>
              <th scope="col">
                <span class="visually-hidden">{words.remove}</span>
              </th>
            </tr>
          </thead>
          <tbody ref={legend}>
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
                <td class="number" data-value />
                <td class="number" data-low />
                <td class="number" data-high />
                <td class="number">
                  <button
                    type="button"
                    class="quiet-button"
                    aria-label={words.removeCurve(path)}
                    onClick={() => props.onRemove(path)}
                  >
                    ×
                  </button>
                </td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </>
  );
}

function paint(one: Chart, props: Props, beginS: number, endS: number): void {
  const {chart, axes, axisOf} = one;
  const fields = props.plot.fields.map((path) => props.data.field(path));
  const count = Math.min(kColumnMax, Math.max(50, chart.over.clientWidth));
  const curves = fields.filter((field) => field !== null);
  if (curves.length !== axisOf.length) return;
  const binned = bin(curves, beginS, endS, count);
  binned.values.forEach((column, i) => {
    const factor = axes[axisOf[i] ?? 0]?.factor ?? 1;
    if (factor === 1) return;
    column.forEach((value, row) => {
      if (typeof value === 'number') column[row] = value * factor;
    });
  });
  one.binned = binned;
  chart.setData([binned.times, ...binned.values] as uPlot.AlignedData);
}

/** The values at the crosshair, else the newest; and what passes a threshold now. */
function writeLegend(
  one: Chart,
  props: Props,
  body: HTMLTableSectionElement | null,
  alarms: HTMLParagraphElement | null,
): void {
  const {axes, axisOf, binned} = one;
  if (body === null || binned === null) return;
  const crossS = props.view.crosshairS.peek();
  const isFollowing = props.view.fixed.peek() === null;
  const passed: string[] = [];
  props.plot.fields.forEach((path, i) => {
    const axis = axes[axisOf[i] ?? 0];
    const row = body.children[i];
    const field = props.data.field(path);
    if (axis === undefined || row === undefined || field === null) return;
    const show = (name: string, text: string) => {
      const cell = row.querySelector(`[data-${name}]`);
      if (cell !== null && cell.textContent !== text) cell.textContent = text;
    };
    const plain = (value: number) => fixed(value * axis.prefix.factor, axis.digits);
    const unit = unitText(axis);
    const isFresh = props.isLive() && props.nowMs() - field.cameMs <= kStaleMs;
    const newest = field.ring.valueAt(field.ring.size - 1);
    const at =
      crossS === null && isFollowing && isFresh
        ? ([newest * axis.factor, newest * axis.factor] as const)
        : valuesAt(binned, i, crossS ?? props.view.range()[1]);
    const isStale = crossS === null && isFollowing && !isFresh;
    const [low, high] = at ?? [NaN, NaN];
    const both = plain(low) === plain(high) ? plain(low) : `${plain(low)} … ${plain(high)}`;
    // An old value is not shown as if it were new.
    show('value', at === null || (isStale && field.ring.size > 0) ? '–' : `${both} ${unit}`);
    const numbers = (binned.values[i] ?? []).filter((value) => typeof value === 'number');
    let lowest = Infinity;
    let highest = -Infinity;
    for (const value of numbers) {
      lowest = Math.min(lowest, value);
      highest = Math.max(highest, value);
    }
    show('low', numbers.length === 0 ? '–' : plain(lowest));
    show('high', numbers.length === 0 ? '–' : plain(highest));
    if (!isFresh) return;
    for (const threshold of props.plot.thresholds) {
      if (threshold.unit !== axis.unit) continue;
      const isPassed =
        threshold.side === 'above' ? newest > threshold.value : newest < threshold.value;
      if (!isPassed) continue;
      const limit = `${shownNumber(axis, threshold.value)} ${unit}`;
      const name = threshold.label === '' ? limit : `${threshold.label} (${limit})`;
      passed.push(
        texts.peek().plots[threshold.side === 'above' ? 'isAbove' : 'isBelow'](path, name),
      );
    }
  });
  if (alarms === null) return;
  const text = passed.length === 0 ? '' : `⚠ ${passed.join(' · ')}`;
  if (alarms.textContent !== text) alarms.textContent = text;
  alarms.hidden = text === '';
}

/** The pointer over a plot: crosshair, zoom by dragging, wheel and pan. */
class Pointer {
  /** Since the newest paint. */
  moved = false;
  private readonly cross = document.createElement('div');
  private readonly label = document.createElement('span');
  private readonly select = document.createElement('div');
  private drag: {readonly x: number; readonly isPan: boolean; lastX: number} | null = null;

  constructor(
    private readonly chart: uPlot,
    private readonly view: TimeView,
  ) {
    const {over} = chart;
    this.cross.className = 'plot-cross';
    this.select.className = 'plot-select';
    this.cross.append(this.label);
    this.select.hidden = this.cross.hidden = true;
    over.append(this.select, this.cross);
    over.addEventListener('pointerdown', this.onDown);
    over.addEventListener('pointermove', this.onMove);
    over.addEventListener('pointerup', this.onUp);
    over.addEventListener('pointercancel', this.onUp);
    over.addEventListener('pointerleave', this.onLeave);
    over.addEventListener('dblclick', this.onDouble);
    over.addEventListener('wheel', this.onWheel, {passive: false});
  }

  /** The listeners go with the chart's elements. */
  end(): void {
    this.drag = null;
  }

  paint(beginS: number, endS: number): void {
    const crossS = this.view.crosshairS.peek();
    const width = this.chart.over.clientWidth;
    const isShown = crossS !== null && crossS >= beginS && crossS <= endS;
    this.cross.hidden = !isShown;
    if (!isShown) return;
    const share = (crossS - beginS) / (endS - beginS);
    const stepS = (endS - beginS) / 1000;
    this.cross.style.transform = `translateX(${(share * width).toFixed(1)}px)`;
    this.cross.classList.toggle('is-right', share > 0.8);
    const text = clockText(crossS, stepS);
    if (this.label.textContent !== text) {
      this.label.textContent = text;
      this.moved = true;
    }
  }

  private timeAt(x: number): number {
    const [beginS, endS] = this.view.range();
    return beginS + ((endS - beginS) * x) / Math.max(1, this.chart.over.clientWidth);
  }

  private xOf(event: MouseEvent): number {
    return event.clientX - this.chart.over.getBoundingClientRect().left;
  }

  private readonly onDown = (event: PointerEvent) => {
    if (event.button > 1) return;
    const x = this.xOf(event);
    const isPan = event.pointerType === 'touch' || event.shiftKey || event.button === 1;
    this.drag = {x, isPan, lastX: x};
    this.chart.over.setPointerCapture(event.pointerId);
    if (event.button === 1) event.preventDefault();
  };

  private readonly onMove = (event: PointerEvent) => {
    const x = this.xOf(event);
    this.moved = true;
    this.view.crosshairS.value = this.timeAt(x);
    if (this.drag === null) return;
    if (this.drag.isPan) {
      if (Math.abs(x - this.drag.x) < kDragMinPx && this.drag.lastX === this.drag.x) return;
      this.view.pan(this.timeAt(this.drag.lastX) - this.timeAt(x));
      this.drag.lastX = x;
    } else {
      const isDrag = Math.abs(x - this.drag.x) >= kDragMinPx;
      this.select.hidden = !isDrag;
      this.select.style.left = `${Math.min(x, this.drag.x)}px`;
      this.select.style.width = `${Math.abs(x - this.drag.x)}px`;
    }
  };

  private readonly onUp = (event: PointerEvent) => {
    const drag = this.drag;
    this.drag = null;
    this.select.hidden = true;
    const x = this.xOf(event);
    if (drag === null || drag.isPan || event.type === 'pointercancel') return;
    if (Math.abs(x - drag.x) < kDragMinPx) return;
    const [fromS, toS] = [this.timeAt(drag.x), this.timeAt(x)];
    this.view.show(Math.min(fromS, toS), Math.max(fromS, toS));
  };

  private readonly onLeave = () => {
    this.moved = true;
    if (this.drag === null) this.view.crosshairS.value = null;
  };

  private readonly onDouble = () => this.view.follow();

  private readonly onWheel = (event: WheelEvent) => {
    event.preventDefault();
    this.moved = true;
    const isPan = Math.abs(event.deltaX) > Math.abs(event.deltaY) || event.shiftKey;
    const [beginS, endS] = this.view.range();
    if (isPan) {
      const delta = event.deltaX !== 0 ? event.deltaX : event.deltaY;
      this.view.pan(((endS - beginS) * delta) / Math.max(1, this.chart.over.clientWidth));
    } else {
      this.view.zoom(event.deltaY < 0 ? kZoomStep : 1 / kZoomStep, this.timeAt(this.xOf(event)));
    }
  };
}

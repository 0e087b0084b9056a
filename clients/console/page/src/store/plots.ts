import {computed, effect, signal, type Signal} from '@preact/signals';
import {
  decode,
  deviceLayout,
  encode,
  kCurveMax,
  kCurvesInAllMax,
  kNameMax,
  kPlotMax,
  kThresholdMax,
  kWindowMaxS,
  kWindowMinS,
  plain,
  readLayout,
  type Layout,
  type Plot,
  type Threshold,
} from '../model/layout';
import {lengthOf, moved, timeAt, within, zoomed, type Span} from '../model/span';
import type {Device} from '../model/state';
import {list} from '../protocol/fields';
import {recallJson, remember} from './kept';
import {PlotData} from './plot_data';
import type {Link} from './link';
import type {ReadonlySignal} from '@preact/signals';

const kSavedKey = 'rtpm.plots.saved';
const kCurrentKey = 'rtpm.plots.current';
const kSavedMax = 50;
const kShared = 'layout/';
const kOfDevice = 'of/';

const kEmpty: Layout = {name: '', windowS: 30, plots: []};

/** The time that all plots show, and their common crosshair. */
export class TimeView {
  /** The span that stays; null: the newest `windowS` seconds. */
  readonly fixed: Signal<Span | null> = signal(null);
  readonly crosshairS: Signal<number | null> = signal(null);
  /** The part that a pointer draws. */
  readonly brush: Signal<Span | null> = signal(null);

  constructor(
    private readonly windowS: () => number,
    /** The console's clock. */
    private readonly nowS: () => number,
  ) {}

  get span(): Span {
    const toS = this.nowS();
    return this.fixed.peek() ?? {fromS: toS - this.windowS(), toS};
  }

  /** The past has no end that the page knows, and the future is empty. */
  get whole(): Span {
    return {fromS: -Infinity, toS: this.nowS()};
  }

  pause(): void {
    this.fixed.value = this.span;
  }

  follow(): void {
    this.fixed.value = null;
  }

  show(span: Span): void {
    const excessS = Math.max(0, lengthOf(span) - kWindowMaxS) / 2;
    const shown = {fromS: span.fromS + excessS, toS: span.toS - excessS};
    this.fixed.value = within(shown, this.whole);
  }

  /** Below 1: closer. */
  zoom(factor: number): void {
    this.show(zoomed(this.span, factor, timeAt(this.span, 0.5), this.whole));
  }

  /** By a share of what shows. */
  move(share: number): void {
    this.show(moved(this.span, share, this.whole));
  }
}

/** A change of the saved layouts that can be undone. */
interface Undo {
  readonly what: 'deleted' | 'replaced' | 'renamed' | 'changed';
  readonly name: string;
  readonly saved: readonly Layout[];
  readonly layout: Layout;
}

/** The layout that is shown, and those that are saved in this browser. */
export class Plots {
  readonly layout: Signal<Layout>;
  readonly saved: Signal<readonly Layout[]> = signal(readSaved());
  readonly undo: Signal<Undo | null> = signal(null);
  /** The address has a layout that can't be read. */
  readonly isLinkBroken: Signal<boolean> = signal(false);
  readonly data: PlotData;
  readonly view: TimeView;
  /** The plot that new curves go to. */
  readonly target: Signal<number> = signal(0);

  constructor(
    link: Link,
    private readonly devices: ReadonlySignal<readonly Device[]>,
    isVisible: ReadonlySignal<boolean>,
    nowMs: () => number,
    consoleMs: () => number,
  ) {
    this.layout = signal(readCurrent() ?? kEmpty);
    this.data = new PlotData(link, devices, isVisible, nowMs);
    this.view = new TimeView(
      () => this.layout.peek().windowS,
      () => consoleMs() / 1000,
    );
    effect(() => remember(kCurrentKey, JSON.stringify(this.layout.value)));
    effect(() => remember(kSavedKey, JSON.stringify(this.saved.value)));
  }

  readonly curveCount = computed(() =>
    this.layout.value.plots.reduce((sum, plot) => sum + plot.fields.length, 0),
  );

  /** Takes what the address asks for; the devices may come later than it. */
  open(subject: string): void {
    this.isLinkBroken.value = false;
    if (subject.startsWith(kShared)) {
      const layout = decode(subject.slice(kShared.length));
      this.isLinkBroken.value = layout === null;
      if (layout !== null) this.show(layout);
    } else if (subject.startsWith(kOfDevice)) {
      const name = subject.slice(kOfDevice.length);
      const device = this.devices.value.find((one) => one.name === name);
      if (device !== undefined) this.show(deviceLayout(device));
    } else if (this.layout.peek().plots.length === 0) {
      const first =
        this.devices.value.find((one) => one.className === 'haptic') ?? this.devices.value[0];
      if (first !== undefined) this.show(deviceLayout(first));
    }
  }

  show(layout: Layout): void {
    this.layout.value = layout;
    this.target.value = 0;
    this.view.follow();
  }

  setWindow(windowS: number): void {
    const bounded = Math.min(kWindowMaxS, Math.max(kWindowMinS, windowS));
    this.layout.value = {...this.layout.peek(), windowS: bounded};
    this.view.follow();
  }

  /** Adds curves to the target; false where there are too many. */
  add(paths: readonly string[]): boolean {
    const layout = this.layout.peek();
    const at = Math.min(this.target.peek(), layout.plots.length);
    if (at === layout.plots.length && layout.plots.length >= kPlotMax) return false;
    const plot = layout.plots[at] ?? {title: '', kind: 'time' as const, fields: [], thresholds: []};
    const fresh = paths.filter((path) => !plot.fields.includes(path));
    const isTooMany =
      plot.fields.length + fresh.length > kCurveMax ||
      this.curveCount.peek() + fresh.length > kCurvesInAllMax ||
      plot.kind !== 'time';
    if (isTooMany) return false;
    this.target.value = at;
    this.setPlot(at, {...plot, fields: [...plot.fields, ...fresh]});
    return true;
  }

  removeCurve(at: number, path: string): void {
    const plot = this.layout.peek().plots[at];
    if (plot === undefined) return;
    this.remember('changed', path);
    this.setPlot(at, {...plot, fields: plot.fields.filter((one) => one !== path)});
  }

  removePlot(at: number): void {
    const layout = this.layout.peek();
    this.remember('changed', titleOf(layout.plots[at]));
    this.layout.value = {...layout, plots: layout.plots.filter((_, i) => i !== at)};
    this.target.value = 0;
  }

  movePlot(at: number, by: number): void {
    const plots = [...this.layout.peek().plots];
    const [plot] = plots.splice(at, 1);
    if (plot === undefined) return;
    plots.splice(Math.min(plots.length, Math.max(0, at + by)), 0, plot);
    this.layout.value = {...this.layout.peek(), plots};
  }

  setTitle(at: number, title: string): void {
    const plot = this.layout.peek().plots[at];
    if (plot !== undefined) this.setPlot(at, {...plot, title: plain(title, kNameMax)});
  }

  setThresholds(at: number, thresholds: readonly Threshold[]): void {
    const plot = this.layout.peek().plots[at];
    if (plot === undefined) return;
    this.setPlot(at, {...plot, thresholds: thresholds.slice(0, kThresholdMax)});
  }

  /** Saves what is shown by this name, in the place of one that has it. */
  save(name: string): boolean {
    const named = plain(name, kNameMax);
    const others = this.saved.peek().filter((one) => one.name !== named);
    if (named === '' || others.length >= kSavedMax) return false;
    if (others.length < this.saved.peek().length) this.remember('replaced', named);
    this.layout.value = {...this.layout.peek(), name: named};
    this.saved.value = sorted([...others, this.layout.peek()]);
    return true;
  }

  rename(before: string, after: string): boolean {
    const named = plain(after, kNameMax);
    const known = this.saved.peek();
    if (named === '' || known.some((one) => one.name === named && named !== before)) return false;
    this.remember('renamed', before);
    this.saved.value = sorted(
      known.map((one) => (one.name === before ? {...one, name: named} : one)),
    );
    if (this.layout.peek().name === before)
      this.layout.value = {...this.layout.peek(), name: named};
    return true;
  }

  remove(name: string): void {
    this.remember('deleted', name);
    this.saved.value = this.saved.peek().filter((one) => one.name !== name);
  }

  revert(): void {
    const undo = this.undo.peek();
    if (undo === null) return;
    this.saved.value = undo.saved;
    this.layout.value = undo.layout;
    this.undo.value = null;
  }

  /** The address of what is shown. */
  get subject(): string {
    return `${kShared}${encode(this.layout.value)}`;
  }

  private remember(what: Undo['what'], name: string): void {
    this.undo.value = {what, name, saved: this.saved.peek(), layout: this.layout.peek()};
  }

  private setPlot(at: number, plot: Plot): void {
    const plots = [...this.layout.peek().plots];
    plots[at] = plot;
    this.layout.value = {...this.layout.peek(), plots};
  }
}

export function plotsOfDevice(name: string): string {
  return `${kOfDevice}${name}`;
}

export function titleOf(plot: Plot | undefined): string {
  if (plot === undefined) return '';
  if (plot.title !== '') return plot.title;
  return plot.fields
    .map((path) => path.slice(path.lastIndexOf('/') + 1))
    .join(', ')
    .slice(0, kNameMax);
}

function sorted(layouts: readonly Layout[]): readonly Layout[] {
  return [...layouts].sort((a, b) => a.name.localeCompare(b.name));
}

function readSaved(): readonly Layout[] {
  return list(recallJson(kSavedKey))
    .slice(0, kSavedMax)
    .map(readLayout)
    .filter((one) => one !== null && one.name !== '') as Layout[];
}

function readCurrent(): Layout | null {
  return readLayout(recallJson(kCurrentKey));
}

import {effect, signal, type ReadonlySignal, type Signal} from '@preact/signals';
import {fieldReader, isChange, liveTopicOf, splitPath, subjectOf, unitOf} from '../model/fields';
import {kNoPast, type Curve, type Past} from '../model/points';
import type {Device} from '../model/state';
import {number, numbers, object, objects, text} from '../protocol/fields';
import type {Link} from './link';
import {Series} from './series';

/** Values of five minutes at 60 Hz. */
const kRingRows = 18000;
const kPointMax = 1200;
/** Parameters have no channel: their past is asked for so often. */
const kPollMs = 2000;
const kRefreshMinMs = 5000;
const kDragMs = 150;

/** A field that is shown. */
export class Field implements Curve {
  readonly series = new Series(kRingRows, 1, Float64Array);
  readonly ring = this.series.column(0);
  past: Past = kNoPast;
  /** When its newest value came, by the page's clock. */
  cameMs = -Infinity;

  constructor(
    readonly path: string,
    public unit: string,
  ) {}
}

/** A field that can be shown. */
export interface Found {
  readonly path: string;
  readonly unit: string;
}

export interface FoundFields {
  readonly fields: readonly Found[];
  readonly totalCount: number;
}

/** The values of the fields that are shown, and of no others: the console's past, and what comes. */
export class PlotData {
  /** Counts changes of what the fields are: their units. */
  readonly version: Signal<number> = signal(0);
  /** Why there is no past; empty: there is. */
  readonly problem: Signal<string> = signal('');
  private readonly fields = new Map<string, Field>();
  private readonly paths: Signal<readonly string[]> = signal([]);
  private readonly ends = new Map<string, () => void>();
  private isAsking = false;
  private askedMs = -Infinity;
  private askedRange = '';

  constructor(
    private readonly link: Link,
    private readonly devices: ReadonlySignal<readonly Device[]>,
    private readonly isVisible: ReadonlySignal<boolean>,
    private readonly nowMs: () => number,
  ) {
    effect(() => this.follow());
  }

  get hasPast(): boolean {
    return this.link.services.value.has('console/history');
  }

  /** The paths that are shown, by lines. */
  get shown(): string {
    return this.paths.peek().join('\n');
  }

  field(path: string): Field | null {
    return this.fields.get(path) ?? null;
  }

  /** Shows these fields, and forgets others. */
  show(paths: readonly string[]): void {
    const wanted = new Set(paths);
    for (const path of this.fields.keys()) if (!wanted.has(path)) this.fields.delete(path);
    for (const path of wanted) {
      if (this.fields.has(path)) continue;
      this.fields.set(path, new Field(path, unitOf(path, this.deviceOf(path))));
      this.askedMs = -Infinity;
    }
    this.paths.value = [...wanted];
    this.version.value = this.version.peek() + 1;
  }

  /** Asks for the past of this range, where what is there is of another one, or too old. */
  refresh(beginS: number, endS: number, isFollowing: boolean): void {
    if (this.isAsking || this.fields.size === 0 || !this.link.isLive) return;
    if (!this.link.services.peek().has('console/history')) return;
    const spanMs = 1000 * (endS - beginS);
    const range = isFollowing ? `last ${Math.round(spanMs)}` : `${beginS} ${endS}`;
    const paths = [...this.fields.keys()];
    const hasPolled = paths.some((path) => splitPath(path).topic.endsWith('/config'));
    const everyMs = hasPolled ? kPollMs : Math.max(kRefreshMinMs, spanMs / 100);
    // While a range is dragged, not each step.
    const dueMs =
      this.askedRange !== range ? kDragMs : isFollowing || hasPolled ? everyMs : Infinity;
    if (this.nowMs() - this.askedMs < dueMs) return;
    void this.ask(paths, beginS, endS, range);
  }

  /** Rejects with CallError. */
  async find(query: string, count: number): Promise<FoundFields> {
    const reply = object(await this.link.call('console/fields', {query, count}));
    return {
      fields: objects(reply['fields']).map((one) => ({
        path: text(one['path']),
        unit: text(one['unit']),
      })),
      totalCount: number(reply['total_count']),
    };
  }

  private deviceOf(path: string): Device | null {
    const name = subjectOf(path);
    return this.devices.peek().find((one) => one.name === name) ?? null;
  }

  private async ask(
    paths: readonly string[],
    beginS: number,
    endS: number,
    range: string,
  ): Promise<void> {
    this.isAsking = true;
    this.askedMs = this.nowMs();
    this.askedRange = range;
    try {
      const reply = object(
        await this.link.call('console/history', {
          fields: paths,
          begin_ns: Math.round(beginS * 1e9),
          end_ns: Math.round(endS * 1e9),
          points: kPointMax,
        }),
      );
      for (const column of objects(reply['columns'])) this.take(column);
      this.problem.value = '';
    } catch (error) {
      this.problem.value = (error as Error).message;
    } finally {
      this.isAsking = false;
    }
  }

  private take(column: ReturnType<typeof object>): void {
    const field = this.fields.get(text(column['path']));
    if (field === undefined || column['known'] !== true) return;
    const firstS = number(column['first_ns']) / 1e9;
    const stepS = number(column['step_ns']) / 1e9;
    field.past = {
      stepS,
      times: Float64Array.from(numbers(column['steps']), (step) => firstS + step * stepS),
      low: Float32Array.from(numbers(column['low'])),
      high: Float32Array.from(numbers(column['high'])),
    };
    const unit = text(column['unit']);
    if (unit === field.unit || unit === '') return;
    field.unit = unit;
    this.version.value = this.version.peek() + 1;
  }

  private follow(): void {
    const channels = this.link.channels.value;
    const wanted = new Map<string, readonly string[]>();
    if (this.isVisible.value) {
      for (const path of this.paths.value) {
        const {topic} = splitPath(path);
        wanted.set(topic, [...(wanted.get(topic) ?? []), path]);
      }
    }
    const keys = new Set<string>();
    for (const [topic, paths] of wanted) {
      const live = liveTopicOf(topic, channels);
      if (live === null) continue;
      // The parts of a device name the elements of its arrays, so they come with the state.
      const device = this.devices.value.find((one) => one.name === subjectOf(`${topic}.`));
      const parts = [device?.joints, device?.analogs, device?.outputs]
        .flatMap((scales) => scales?.map((one) => one.name) ?? [])
        .join();
      const key = [live.channel, live.change, parts, ...paths].join('\n');
      keys.add(key);
      if (this.ends.has(key)) continue;
      const readers = paths.map((path) => ({
        field: this.fields.get(path),
        read: fieldReader(splitPath(path).field, device ?? null),
      }));
      const end = this.link.subscribe(live.channel, ({timeNs, value}) => {
        if (live.change !== '' && !isChange(value, live.change)) return;
        const timeS = Number(timeNs) / 1e9;
        const payload =
          live.change === ''
            ? value
            : ((value as {readonly payload?: typeof value}).payload ?? null);
        for (const {field, read} of readers) {
          if (field === undefined) continue;
          const number = read(payload);
          if (Number.isNaN(number)) continue;
          field.series.push(timeS, [number]);
          field.cameMs = this.nowMs();
        }
      });
      this.ends.set(key, end);
      // The console's past has the values that were missed meanwhile.
      this.askedMs = -Infinity;
    }
    for (const [key, end] of this.ends) {
      if (keys.has(key)) continue;
      end();
      this.ends.delete(key);
    }
    this.nameUnits();
  }

  /** By the devices' descriptions, which may come later than the layout. */
  private nameUnits(): void {
    for (const [path, field] of this.fields) {
      if (field.unit !== '') continue;
      field.unit = unitOf(path, this.deviceOf(path));
      if (field.unit !== '') this.version.value = this.version.peek() + 1;
    }
  }
}

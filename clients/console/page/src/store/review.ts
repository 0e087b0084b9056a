import {signal, type Signal} from '@preact/signals';
import {
  readCurves,
  readNotes,
  readRun,
  timeNsAt,
  type Curves,
  type Happening,
  type Run,
} from '../model/review';
import type {Span} from '../model/span';
import {object, text} from '../protocol/fields';
import type {Json, JsonObject} from '../protocol/json';
import type {Link} from './link';

const kPollMs = 400;
/** A recording that was not ended is read as a whole before it opens. */
const kOpenTimeoutMs = 120_000;
const kSeriesTimeoutMs = 20_000;
const kCutTimeoutMs = 600_000;
const kFieldMax = 64;

interface Wanted {
  readonly fields: readonly string[];
  readonly span: Span;
  readonly points: number;
}

/** A recording that is reviewed: its facts, and the curves of what shows. */
export class Review {
  readonly run: Signal<Run | null> = signal(null);
  readonly problem: Signal<string> = signal('');
  /** The whole recording's. */
  readonly overview: Signal<Curves | null> = signal(null);
  /** The shown part's. */
  readonly curves: Signal<Curves | null> = signal(null);
  readonly isReading: Signal<boolean> = signal(false);
  private isOver = false;
  private isBusy = false;
  private readonly wanted: {overview: Wanted | null; curves: Wanted | null} = {
    overview: null,
    curves: null,
  };
  private timer: ReturnType<typeof setTimeout> | null = null;

  constructor(
    private readonly link: Link,
    readonly file: string,
  ) {}

  /** Opens it, and follows while the console reads its overview. */
  async open(): Promise<void> {
    try {
      const reply = await this.call('review_open', {}, kOpenTimeoutMs);
      if (this.isOver) return;
      this.problem.value = '';
      const before = this.run.peek()?.progress ?? 0;
      this.run.value = readRun(this.file, reply);
      if (before < 1) this.again();
    } catch (error) {
      if (this.isOver) return;
      this.problem.value = (error as Error).message;
      return;
    }
    const run = this.run.value;
    if (run !== null && (run.progress < 1 || run.cut !== null)) this.openLater();
  }

  end(): void {
    this.isOver = true;
    if (this.timer !== null) clearTimeout(this.timer);
  }

  /** Asks for curves; while one question is open, only the newest other one waits. */
  show(lane: 'overview' | 'curves', fields: readonly string[], span: Span, points: number): void {
    this.wanted[lane] = {fields: fields.slice(0, kFieldMax), span, points};
    void this.work();
  }

  async annotate(atS: number, note: string): Promise<string> {
    const run = this.run.value;
    if (run === null) return '';
    return this.changeNotes({time_ns: timeNsAt(run.beginNs, atS), text: note});
  }

  async removeNote(note: Happening): Promise<string> {
    return this.changeNotes({time_ns: note.timeNs, made_ns: note.madeNs});
  }

  /** The name of the part's file; rejects with the reason. */
  async cut(span: Span, name: string): Promise<string> {
    const run = this.run.value;
    if (run === null) return '';
    const request = {
      begin_ns: timeNsAt(run.beginNs, span.fromS),
      end_ns: timeNsAt(run.beginNs, span.toS),
      name,
    };
    const done = this.call('recording_cut', request, kCutTimeoutMs);
    this.openLater();
    return text(object(await done)['file']);
  }

  private openLater(): void {
    if (this.timer !== null) clearTimeout(this.timer);
    this.timer = setTimeout(() => void this.open(), kPollMs);
  }

  private async changeNotes(request: JsonObject): Promise<string> {
    try {
      const reply = object(await this.call('recording_annotate', request));
      const run = this.run.value;
      if (run !== null) this.run.value = {...run, notes: readNotes(run.beginNs, reply['notes'])};
      return '';
    } catch (error) {
      return (error as Error).message;
    }
  }

  /** The overview has more than before. */
  private again(): void {
    for (const lane of ['overview', 'curves'] as const) this.wanted[lane] ??= this.last[lane];
    void this.work();
  }
  private readonly last: {overview: Wanted | null; curves: Wanted | null} = {
    overview: null,
    curves: null,
  };

  private async work(): Promise<void> {
    if (this.isBusy) return;
    this.isBusy = true;
    for (;;) {
      const run = this.run.peek();
      const lane = this.wanted.curves !== null ? 'curves' : 'overview';
      const wanted = this.wanted[lane];
      if (this.isOver || run === null || wanted === null) break;
      this.wanted[lane] = null;
      this.last[lane] = wanted;
      if (wanted.fields.length === 0) {
        this[lane].value = null;
        continue;
      }
      this.isReading.value = lane === 'curves';
      const request = {
        fields: wanted.fields,
        begin_ns: timeNsAt(run.beginNs, wanted.span.fromS),
        end_ns: timeNsAt(run.beginNs, Math.max(wanted.span.toS, wanted.span.fromS + 1e-6)),
        points: wanted.points,
      };
      try {
        const reply = await this.call('review_series', request, kSeriesTimeoutMs);
        this[lane].value = readCurves(run.beginNs, reply);
        this.problem.value = this[lane].value.problem;
      } catch (error) {
        if (!this.isOver) this.problem.value = (error as Error).message;
      }
    }
    this.isReading.value = false;
    this.isBusy = false;
  }

  private call(method: string, request: JsonObject, timeoutMs = 5000): Promise<Json> {
    return this.link.call(`console/${method}`, {...request, file: this.file}, timeoutMs);
  }
}

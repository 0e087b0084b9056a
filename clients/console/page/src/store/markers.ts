import {computed, signal, type ReadonlySignal, type Signal} from '@preact/signals';
import {list, number, numberOrNull, object, objects, text} from '../protocol/fields';
import type {Json, JsonObject} from '../protocol/json';
import type {CallError, Message} from '../protocol/client';
import {recallJson, remember} from './kept';
import type {Link} from './link';

export type Phase = 'mark' | 'begin' | 'end';

/** A step of an experiment: the event rtpm.Trial, or one that this page sends. */
export interface Marker {
  readonly key: number;
  /** On the console's clock, since 1970. */
  readonly timeNs: number;
  /** Its note; else "trial 3". */
  readonly label: string;
  readonly phase: Phase;
  /** The trial's, from 1; 0: outside of trials. */
  readonly number: number;
  readonly source: number;
  readonly condition: string;
  readonly response: string;
  /** An end has it: since the beginning. */
  readonly durationNs: number | null;
}

/** A trial as an interval; `endNs` is null while it goes on. */
export interface Trial {
  readonly key: number;
  readonly source: number;
  readonly number: number;
  readonly beginNs: number;
  readonly endNs: number | null;
  readonly condition: string;
  readonly response: string;
}

/** A mark on its way, or one that the hub did not confirm. */
export interface Sent {
  readonly key: number;
  readonly timeNs: number;
  readonly label: string;
  readonly state: 'waits' | 'failed';
  readonly why: string;
}

export interface MarkRequest {
  readonly label?: string;
  readonly phase?: Phase;
  readonly number?: number;
  readonly condition?: string;
  readonly response?: string;
}

/** A button of the marker bar, and its key; an empty key: none. */
export interface MarkButton {
  readonly label: string;
  readonly key: string;
}

/** The newest markers that the page keeps, and the buttons that it has. */
export const kMarkerMax = 2000;
export const kButtonMax = 12;
const kSentMax = 20;
/** A mark that the lost connection has not taken is sent for so long. */
export const kResendMs = 60_000;
const kButtonsKey = 'rtpm.markers';
const kShowMs = 100;

const kFirstButtons: readonly MarkButton[] = [
  {label: 'event', key: 'm'},
  {label: 'repeat', key: 'r'},
];

/** The markers of the live system or of a recording: the newest `kMarkerMax`, by time. */
export class MarkerList {
  readonly rows: Signal<readonly Marker[]> = signal([]);
  /** Markers that came and are not kept: the oldest, or more than the console shows. */
  readonly omittedCount: Signal<number> = signal(0);
  readonly trials: ReadonlySignal<readonly Trial[]> = computed(() => trialsOf(this.rows.value));
  private incoming: Marker[] = [];
  private timer: ReturnType<typeof setTimeout> | null = null;

  add(markers: readonly Marker[], omittedCount = 0): void {
    this.incoming.push(...markers);
    this.omit(omittedCount + Math.max(0, this.incoming.length - kMarkerMax));
    this.incoming = this.incoming.slice(-kMarkerMax);
    // Charts and list are laid out a few times a second, however many come.
    this.timer ??= setTimeout(() => this.show(), kShowMs);
  }

  clear(): void {
    this.incoming = [];
    this.rows.value = [];
    this.omittedCount.value = 0;
  }

  show(): void {
    if (this.timer !== null) clearTimeout(this.timer);
    this.timer = null;
    if (this.incoming.length === 0) return;
    // A replay that is played again has the same ones again.
    const unique = new Map([...this.rows.peek(), ...this.incoming].map((one) => [idOf(one), one]));
    const all = [...unique.values()].sort((a, b) => a.timeNs - b.timeNs);
    this.incoming = [];
    this.omit(Math.max(0, all.length - kMarkerMax));
    this.rows.value = all.slice(-kMarkerMax);
  }

  private omit(count: number): void {
    if (count > 0) this.omittedCount.value = this.omittedCount.peek() + count;
  }
}

/** Markers and trials of an experiment: what came, and what this page marks. */
export class Markers {
  readonly live = new MarkerList();
  readonly replayed = new MarkerList();
  readonly sent: Signal<readonly Sent[]> = signal([]);
  readonly buttons: Signal<readonly MarkButton[]> = signal(readButtons());
  /** The number of the next trial. */
  readonly nextNumber: ReadonlySignal<number>;
  /** The newest trial that has begun and not ended; null: none. */
  readonly open: ReadonlySignal<Trial | null>;
  private lastKey = 0;

  constructor(
    private readonly link: Link,
    private readonly consoleMs: () => number,
    private readonly nowMs: () => number,
  ) {
    this.nextNumber = computed(
      () => 1 + this.live.rows.value.reduce((most, one) => Math.max(most, own(one)), 0),
    );
    this.open = computed(
      () =>
        this.live.trials.value.filter((one) => one.source === 0 && one.endNs === null).at(-1) ??
        null,
    );
    link.subscribe('console/marks', (message) => this.take(message));
    const ends = new Map<string, () => void>();
    link.channels.subscribe((channels) => {
      const topics = [...channels.keys()].filter((one) => one.startsWith('replay/rtpm.Trial/'));
      for (const topic of topics) {
        if (!ends.has(topic))
          ends.set(
            topic,
            link.subscribe(topic, (one) => this.takeReplayed(one)),
          );
      }
      for (const [topic, end] of ends) {
        if (topics.includes(topic)) continue;
        end();
        ends.delete(topic);
      }
      if (topics.length === 0) this.replayed.clear();
    });
  }

  /** Sends a mark at the present; what a lost connection has not taken is sent when it is back. */
  async mark(request: MarkRequest): Promise<boolean> {
    const timeNs = Math.round(this.consoleMs() * 1e6);
    const pressedMs = this.nowMs();
    const key = ++this.lastKey;
    // By it the console knows a repeated request, whose answer was lost.
    const id = Math.floor(Math.random() * Number.MAX_SAFE_INTEGER);
    const label = labelOf(request.label ?? '', request.phase ?? 'mark', request.number ?? 0);
    const say = (state: 'waits' | 'failed', why: string) => {
      const others = this.sent.peek().filter((one) => one.key !== key);
      this.sent.value = [...others, {key, timeNs, label, state, why}].slice(-kSentMax);
    };
    say('waits', '');
    for (;;) {
      try {
        await this.link.call('console/mark', {...request, id, time_ns: timeNs});
        this.sent.value = this.sent.peek().filter((one) => one.key !== key);
        return true;
      } catch (error) {
        const why = (error as Error).message;
        const isUnsent = (error as CallError).isLost && !this.link.isLive;
        const isLate = this.nowMs() - pressedMs > kResendMs;
        if (!isUnsent || isLate) {
          say('failed', why);
          return false;
        }
        say('waits', why);
        await this.untilLive(pressedMs + kResendMs);
      }
    }
  }

  /** Forgets a mark that failed. */
  dismiss(key: number): void {
    this.sent.value = this.sent.value.filter((one) => one.key !== key);
  }

  setButtons(buttons: readonly MarkButton[]): void {
    this.buttons.value = buttons.slice(0, kButtonMax);
    remember(kButtonsKey, JSON.stringify(this.buttons.value));
  }

  private untilLive(endMs: number): Promise<void> {
    return new Promise((resolve) => {
      const timer = setInterval(() => {
        if (!this.link.services.peek().has('console/mark') && this.nowMs() < endMs) return;
        clearInterval(timer);
        resolve();
      }, 200);
    });
  }

  private take(message: Message): void {
    const fields = object(message.value as Json);
    // The first message of a connection has all that the console keeps.
    if (fields['is_first'] === true) this.live.clear();
    const marks = list(fields['marks']).map((one) => this.read(object(one)));
    this.live.add(marks, number(fields['omitted']));
  }

  private takeReplayed(message: Message): void {
    const fields = object(message.value as Json);
    const phases: readonly Phase[] = ['mark', 'begin', 'end'];
    const phase = phases[number(fields['phase'])] ?? 'mark';
    this.replayed.add([
      this.read({...fields, phase, time_ns: Number(message.timeNs), label: fields['note'] ?? ''}),
    ]);
  }

  private read(fields: JsonObject): Marker {
    const given = text(fields['phase']);
    const phase = given === 'begin' || given === 'end' ? given : 'mark';
    const trial = number(fields['number']);
    return {
      key: ++this.lastKey,
      timeNs: number(fields['time_ns']),
      label: labelOf(text(fields['label']), phase, trial),
      phase,
      number: trial,
      source: number(fields['source']),
      condition: text(fields['condition']),
      response: text(fields['response']),
      durationNs: numberOrNull(fields['duration_ns']),
    };
  }
}

/** The trials of the console's own source, which its next number continues. */
function own(marker: Marker): number {
  return marker.source === 0 ? marker.number : 0;
}

function idOf({timeNs, source, phase, number: trial, label}: Marker): string {
  return `${timeNs} ${source} ${phase} ${trial} ${label}`;
}

function labelOf(label: string, phase: Phase, trial: number): string {
  if (label !== '' || trial === 0) return label;
  return phase === 'mark' ? `trial ${trial}` : `trial ${trial} ${phase}`;
}

/** Pairs begins and ends; an end without its begin tells when that was. */
export function trialsOf(markers: readonly Marker[]): Trial[] {
  const trials: Trial[] = [];
  const open = new Map<string, number>();
  for (const one of markers) {
    if (one.phase === 'mark') continue;
    const id = `${one.source}/${one.number}`;
    const {key, source, condition, response} = one;
    const found = open.get(id);
    if (one.phase === 'begin') {
      open.set(id, trials.length);
      const {number, timeNs} = one;
      trials.push({key, source, number, beginNs: timeNs, endNs: null, condition, response});
      continue;
    }
    open.delete(id);
    const begun = found === undefined ? null : (trials[found] ?? null);
    const beginNs =
      begun?.beginNs ?? (one.durationNs === null ? null : one.timeNs - one.durationNs);
    if (beginNs === null) continue;
    const trial = {
      key: begun?.key ?? key,
      source,
      number: one.number,
      beginNs,
      endNs: one.timeNs,
      condition: condition !== '' ? condition : (begun?.condition ?? ''),
      response,
    };
    if (found === undefined) trials.push(trial);
    else trials[found] = trial;
  }
  return trials;
}

function readButtons(): readonly MarkButton[] {
  const kept = recallJson(kButtonsKey);
  if (!Array.isArray(kept)) return kFirstButtons;
  return objects(kept)
    .map((one) => ({label: text(one['label']), key: text(one['key'])}))
    .filter((one) => one.label !== '')
    .slice(0, kButtonMax);
}

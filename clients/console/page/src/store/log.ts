import {signal, type Signal} from '@preact/signals';
import {flag, number, numberOrNull, object, text} from '../protocol/fields';
import {writeJson, type Json} from '../protocol/json';
import type {Message} from '../protocol/client';
import type {Link} from './link';

export interface LogRow {
  readonly key: number;
  readonly timeS: number;
  readonly type: string;
  readonly from: string;
  readonly sequence: string;
  readonly payload: string;
  /** The number of events that were left out here. */
  readonly omittedCount: number;
}

export interface FilterFault {
  readonly filter: string;
  readonly offset: number;
  readonly what: string;
}

export const kRowMax = 500;
const kShowMs = 250;

/** The events that pass this page's filter, newest last. */
export class Log {
  readonly rows: Signal<readonly LogRow[]> = signal([]);
  readonly filter: Signal<string | null> = signal(null);
  readonly fault: Signal<FilterFault | null> = signal(null);
  readonly problem: Signal<string> = signal('');
  readonly isPaused: Signal<boolean> = signal(false);
  readonly count: Signal<number> = signal(0);
  private incoming: LogRow[] = [];
  private lastKey = 0;
  private timer: ReturnType<typeof setTimeout> | null = null;

  constructor(private readonly link: Link) {
    link.subscribe('console/log', (message) => this.take(message));
    // A new connection knows no filter yet.
    link.services.subscribe((services) => {
      if (services.has('console/log_filter') && this.filter.peek() !== null) {
        void this.send(this.filter.peek());
      }
    });
  }

  /** Sets the filter, or says what is wrong with it and where; null ends the log. */
  async set(filter: string | null): Promise<void> {
    this.fault.value = null;
    this.problem.value = '';
    await this.send(filter);
  }

  clear(): void {
    this.incoming = [];
    this.rows.value = [];
    this.count.value = 0;
  }

  private async send(filter: string | null): Promise<void> {
    try {
      const reply = object(await this.link.call('console/log_filter', {filter}));
      if (flag(reply['ok'])) {
        this.filter.value = filter;
      } else {
        this.fault.value = {
          filter: filter ?? '',
          offset: number(reply['offset']),
          what: text(reply['what']),
        };
      }
    } catch (error) {
      this.problem.value = (error as Error).message;
    }
  }

  private take(message: Message): void {
    if (this.isPaused.peek()) return;
    const fields = object(message.value as Json);
    const timeNs = numberOrNull(fields['time_ns']) ?? Number(message.timeNs);
    this.incoming.push({
      key: ++this.lastKey,
      timeS: timeNs / 1e9,
      type: text(fields['type']),
      from: text(fields['device'], String(number(fields['source']))),
      sequence: String(number(fields['sequence'])),
      payload: fields['payload'] === undefined ? '' : writeJson(fields['payload']),
      omittedCount: number(fields['omitted']),
    });
    if (this.incoming.length > kRowMax) this.incoming.splice(0, this.incoming.length - kRowMax);
    // The page lays the list out a few times a second, however many events come.
    this.timer ??= setTimeout(() => this.show(), kShowMs);
  }

  private show(): void {
    this.timer = null;
    this.count.value += this.incoming.filter((row) => row.type !== '').length;
    this.rows.value = [...this.rows.value, ...this.incoming].slice(-kRowMax);
    this.incoming = [];
  }
}

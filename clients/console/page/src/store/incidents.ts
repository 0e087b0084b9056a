import {signal, type Signal} from '@preact/signals';
import {readIncidents, type IncidentList} from '../model/incidents';
import type {Json} from '../protocol/json';
import {number, object} from '../protocol/fields';
import type {Link} from './link';

const kTopic = 'console/incidents';

/** The incidents of the laboratory. */
export class Incidents {
  /** Open ones first, then the newest; null: not known yet. */
  readonly list: Signal<IncidentList | null> = signal(null);
  readonly problem: Signal<string> = signal('');
  private readerCount = 0;
  private end: (() => void) | null = null;

  constructor(private readonly link: Link) {}

  /** Reads the list while anybody shows it; returns the end. */
  follow(): () => void {
    if (++this.readerCount === 1) {
      this.end = this.link.subscribe(kTopic, ({value}) => {
        this.list.value = readIncidents(value as Json);
      });
    }
    return () => {
      if (--this.readerCount === 0) this.end?.();
    };
  }

  /** Acknowledges these, or all; returns how many, or null where it was refused. */
  async acknowledge(ids: readonly number[] | 'all'): Promise<number | null> {
    const request = ids === 'all' ? {all: true} : {ids: [...ids]};
    return this.ask(async () => {
      const reply = await this.link.call('console/incident_acknowledge', request);
      return number(object(reply)['acknowledged']);
    });
  }

  /** All that the console has, beyond those of `list`. */
  async all(): Promise<IncidentList | null> {
    return this.ask(async () => readIncidents(await this.link.call(kTopic, {})));
  }

  private async ask<Answer>(work: () => Promise<Answer>): Promise<Answer | null> {
    try {
      const answer = await work();
      this.problem.value = '';
      return answer;
    } catch (error) {
      this.problem.value = (error as Error).message;
      return null;
    }
  }
}

import {signal, type Signal} from '@preact/signals';
import type {Link} from './link';

export type Command =
  'take_over' | 'release' | 'activate' | 'deactivate' | 'recover' | 'rearm' | 'dismiss';

export interface Refusal {
  readonly command: Command;
  readonly words: string;
  /** Another browser operates the device: asking again with force takes it. */
  readonly isForceable: boolean;
}

/** Commands to devices, by the console's lease. */
export class Commands {
  /** The newest refusal of each device. */
  readonly refusals: Signal<ReadonlyMap<string, Refusal>> = signal(new Map());
  readonly pending: Signal<ReadonlySet<string>> = signal(new Set());
  /** The last command, for screen readers and the line below the buttons. */
  readonly done: Signal<ReadonlyMap<string, Command>> = signal(new Map());

  constructor(private readonly link: Link) {}

  async run(command: Command, device: string, isForced = false): Promise<boolean> {
    this.pending.value = new Set([...this.pending.value, device]);
    this.forget(device);
    try {
      const request = isForced ? {device, force: true} : {device};
      await this.link.call(`console/${command}`, request);
      this.done.value = new Map(this.done.value).set(device, command);
      return true;
    } catch (error) {
      const words = (error as Error).message;
      const isForceable = !isForced && /another browser|operates/.test(words);
      this.refusals.value = new Map(this.refusals.value).set(device, {command, words, isForceable});
      return false;
    } finally {
      const pending = new Set(this.pending.value);
      pending.delete(device);
      this.pending.value = pending;
    }
  }

  forget(device: string): void {
    const refusals = new Map(this.refusals.value);
    const done = new Map(this.done.value);
    refusals.delete(device);
    done.delete(device);
    this.refusals.value = refusals;
    this.done.value = done;
  }
}

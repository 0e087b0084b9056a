import {signal, type Signal} from '@preact/signals';
import {object, objects, text, texts} from '../protocol/fields';
import {CallError} from '../protocol/client';
import {texts as shown} from '../texts/texts';
import type {Link} from './link';

/** The outcome of the newest emergency stop that was asked for here. */
export type StopReport =
  | {readonly phase: 'none'}
  | {readonly phase: 'asked'}
  | {readonly phase: 'done'; readonly stopped: readonly string[]; readonly notes: readonly string[]}
  /** `isAnswered`: by the console, which goes on saying what is not stopped. */
  | {readonly phase: 'failed'; readonly words: string; readonly isAnswered: boolean}
  /** No connection: it is sent as soon as there is one, unless that takes too long. */
  | {readonly phase: 'waiting'};

const kTimeoutMs = 2000;
/** A stop that could not be sent for so long is not sent any more: the operator was told. */
const kWaitMs = 30000;

/** The emergency stop: asked for by the button or the key, for one device or for all. */
export class Stop {
  readonly report: Signal<StopReport> = signal({phase: 'none'});
  private waiting: {readonly sinceMs: number; readonly device: string | undefined} | null = null;

  constructor(
    private readonly link: Link,
    private readonly nowMs: () => number,
  ) {
    this.link.services.subscribe((services) => {
      if (services.has('console/estop')) this.sendWaiting();
    });
  }

  /** Stops the device; without one, all devices of all servers. */
  async press(device?: string): Promise<void> {
    this.report.value = {phase: 'asked'};
    try {
      const request = device === undefined ? {} : {device};
      const reply = object(await this.link.call('console/estop', request, kTimeoutMs));
      const failed = objects(reply['failed']).map(
        (one) => `${text(one['device'], '?')}: ${text(one['why'], '?')}`,
      );
      const stopped = texts(reply['stopped']);
      const notes = texts(reply['notes']);
      if (failed.length === 0 && stopped.length === 0 && notes.length > 0) failed.push(...notes);
      this.report.value =
        failed.length === 0
          ? {phase: 'done', stopped, notes}
          : {
              phase: 'failed',
              words: shown.value.stop.notStopped(failed.join('; ')),
              isAnswered: true,
            };
    } catch (error) {
      this.fail(error as Error, device);
    }
  }

  dismiss(): void {
    this.waiting = null;
    this.report.value = {phase: 'none'};
  }

  private fail(error: Error, device: string | undefined): void {
    if (error instanceof CallError && error.isLost) {
      // Asked for one device and then for another: all are stopped.
      const isSame = this.waiting === null || this.waiting.device === device;
      this.waiting = {
        sinceMs: this.waiting?.sinceMs ?? this.nowMs(),
        device: isSame ? device : undefined,
      };
      this.report.value = {phase: 'waiting'};
    } else {
      const words = shown.value.stop.notConfirmed(error.message);
      this.report.value = {phase: 'failed', words, isAnswered: false};
    }
  }

  private sendWaiting(): void {
    if (this.waiting === null) return;
    const {sinceMs, device} = this.waiting;
    this.waiting = null;
    if (this.nowMs() - sinceMs <= kWaitMs) {
      void this.press(device);
    } else {
      const words = shown.value.stop.notSent;
      this.report.value = {phase: 'failed', words, isAnswered: false};
    }
  }
}

/** Ctrl+Shift+Space: two modifiers, so that no typing hits it. */
export function isStopKey(event: KeyboardEvent): boolean {
  return event.code === 'Space' && event.ctrlKey && event.shiftKey && !event.altKey;
}

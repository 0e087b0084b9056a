import {effect, signal, type Signal} from '@preact/signals';
import {number, object} from '../protocol/fields';
import type {Device} from '../model/state';
import {recall, remember} from './kept';
import type {Link} from './link';

const kNameKey = 'rtpm.operator';
const kRoomKey = 'rtpm.room';
export const kNameMax = 40;
/** The console waits for 30 s for an answer. */
const kAnswerTimeoutMs = 33_000;

/** The person at this browser, as other operators see it, and what is asked between them. */
export class Operator {
  readonly name: Signal<string> = signal(recall(kNameKey) ?? '');
  readonly room: Signal<string> = signal(recall(kRoomKey) ?? '');
  /** The console's number of this connection; null: not known. */
  readonly connection: Signal<number | null> = signal(null);
  /** The devices that this browser asks for, and how the last request ended. */
  readonly asked: Signal<ReadonlyMap<string, 'waits' | 'granted' | {readonly why: string}>> =
    signal(new Map());

  constructor(private readonly link: Link) {
    effect(() => {
      if (!link.services.value.has('console/operator')) {
        this.connection.value = null;
        return;
      }
      void this.introduce(this.name.value, this.room.value);
    });
  }

  set(name: string, room: string): void {
    this.name.value = name.trim().slice(0, kNameMax);
    this.room.value = room.trim().slice(0, kNameMax);
    remember(kNameKey, this.name.value);
    remember(kRoomKey, this.room.value);
  }

  /** Whether this browser operates the device. */
  holds(device: Device): boolean {
    if (device.lease.state !== 'held by this console') return false;
    const {operator} = device.lease;
    return operator === null || this.connection.value === null
      ? true
      : operator.connection === this.connection.value;
  }

  async ask(device: string): Promise<void> {
    this.note(device, 'waits');
    try {
      await this.link.call('console/lease_request', {device}, kAnswerTimeoutMs);
      this.note(device, 'granted');
    } catch (error) {
      this.note(device, {why: (error as Error).message});
    }
  }

  async answer(device: string, consent: boolean): Promise<void> {
    // Where it came too late, the console's state shows it.
    await this.link.call('console/lease_answer', {device, consent}).catch(() => undefined);
  }

  async keep(device: string, keep: boolean): Promise<void> {
    await this.link.call('console/lease_keep', {device, keep}).catch(() => undefined);
  }

  forget(device: string): void {
    const asked = new Map(this.asked.value);
    asked.delete(device);
    this.asked.value = asked;
  }

  private note(device: string, state: 'waits' | 'granted' | {readonly why: string}): void {
    this.asked.value = new Map(this.asked.value).set(device, state);
  }

  private async introduce(name: string, room: string): Promise<void> {
    try {
      const reply = object(await this.link.call('console/operator', {name, room}));
      this.connection.value = number(reply['connection']);
    } catch {
      this.connection.value = null;
    }
  }
}

import {signal, type Signal} from '@preact/signals';
import {flag, list, number, object, text} from '../protocol/fields';
import type {Json} from '../protocol/json';
import {texts} from '../texts/texts';
import type {Link} from './link';

export interface Entry {
  readonly file: string;
  readonly byteCount: number;
  readonly beginNs: number;
  readonly endNs: number;
  readonly messageCount: number;
  readonly isComplete: boolean;
}

/** A session and its selection; an empty list of devices: all. */
export interface SessionRequest {
  readonly participant: string;
  readonly experiment: string;
  readonly condition: string;
  readonly notes: string;
  readonly pattern: string;
  readonly devices: readonly string[];
  readonly media: readonly string[];
}

/** Recordings: making them, their list, and playing one. */
export class Recordings {
  readonly entries: Signal<readonly Entry[] | null> = signal(null);
  readonly problem: Signal<string> = signal('');
  readonly done: Signal<string> = signal('');

  constructor(private readonly link: Link) {}

  async refresh(): Promise<void> {
    const reply = await this.ask('recordings', {}, true);
    if (reply === null) return;
    this.entries.value = list(object(reply)['files'])
      .map(object)
      .map((one) => ({
        file: text(one['file']),
        byteCount: number(one['byte_count']),
        beginNs: number(one['begin_ns']),
        endNs: number(one['end_ns']),
        messageCount: number(one['message_count']),
        isComplete: flag(one['is_complete']),
      }))
      .sort((a, b) => b.beginNs - a.beginNs);
  }

  /** Starts a session's recording; without a word about the session, a recording by time. */
  async startSession(session: SessionRequest): Promise<boolean> {
    const {participant, experiment, condition, notes, devices, media} = session;
    const isNamed = participant + experiment + condition + notes !== '' || devices.length > 0;
    const reply = isNamed
      ? await this.ask('session_start', {...session})
      : await this.ask('record_start', {media});
    if (reply === null) return false;
    this.done.value = texts.value.session.recordingTo(text(object(reply)['file']));
    return true;
  }

  async stop(): Promise<void> {
    const reply = await this.ask('record_stop', {});
    if (reply === null) return;
    const end = object(reply);
    const dropCount = number(end['drop_count']);
    this.done.value =
      `${text(end['file'])} is complete: ${number(end['message_count'])} messages` +
      (dropCount > 0 ? `, ${dropCount} dropped.` : ', none dropped.');
    await this.refresh();
  }

  async open(file: string): Promise<boolean> {
    const reply = await this.ask('replay_open', {file});
    return reply !== null && (await this.play(1));
  }

  async play(speed: number): Promise<boolean> {
    return (await this.ask('replay_play', {speed})) !== null;
  }

  async pause(): Promise<void> {
    await this.ask('replay_pause', {});
  }

  async seek(timeNs: number): Promise<void> {
    await this.ask('replay_seek', {time_ns: Math.round(timeNs)});
  }

  async close(): Promise<void> {
    await this.ask('replay_close', {});
  }

  private async ask(method: string, request: Json, isQuiet = false): Promise<Json | null> {
    if (!isQuiet) this.done.value = '';
    try {
      const reply = await this.link.call(`console/${method}`, request);
      this.problem.value = '';
      return reply;
    } catch (error) {
      this.problem.value = (error as Error).message;
      return null;
    }
  }
}

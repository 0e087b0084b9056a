import {signal, type Signal} from '@preact/signals';
import {flag, number, object, objects, text, texts as fieldTexts} from '../protocol/fields';
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
  /** Its session's; empty where it was made in none. */
  readonly participant: string;
  readonly experiment: string;
  readonly condition: string;
}

export interface Deleted {
  readonly id: string;
  readonly file: string;
  readonly deletedMs: number;
  readonly byteCount: number;
}

function readDeleted(reply: Json): readonly Deleted[] {
  return objects(object(reply)['deleted']).map((one) => ({
    id: text(one['id']),
    file: text(one['file']),
    deletedMs: number(one['deleted_ns']) / 1e6,
    byteCount: number(one['byte_count']),
  }));
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
  /** Recordings in the folder that are not in the list. */
  readonly omittedCount: Signal<number> = signal(0);
  readonly deleted: Signal<readonly Deleted[]> = signal([]);
  /** The newest deleted recording, until it is undone or something else is done. */
  readonly undo: Signal<{readonly id: string; readonly file: string} | null> = signal(null);
  /** Deleted recordings that are gone for good since the page was opened. */
  readonly purged: Signal<readonly string[]> = signal([]);

  constructor(private readonly link: Link) {}

  async refresh(): Promise<void> {
    const reply = await this.ask('recordings', {}, true);
    if (reply === null) return;
    this.takePurged(reply);
    this.deleted.value = readDeleted(reply);
    this.omittedCount.value = number(object(reply)['omitted_count']);
    this.entries.value = objects(object(reply)['files'])
      .map((one) => ({
        file: text(one['file']),
        byteCount: number(one['byte_count']),
        beginNs: number(one['begin_ns']),
        endNs: number(one['end_ns']),
        messageCount: number(one['message_count']),
        isComplete: flag(one['is_complete']),
        participant: text(object(one['session'])['participant']),
        experiment: text(object(one['session'])['experiment']),
        condition: text(object(one['session'])['condition']),
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
    this.done.value = texts.value.recordings.complete(
      text(end['file']),
      number(end['message_count']),
      dropCount,
    );
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

  /** Returns why it was refused; empty: it is renamed. */
  async rename(file: string, name: string): Promise<string> {
    if ((await this.ask('recording_rename', {file, name})) === null) return this.takeProblem();
    await this.refresh();
    this.done.value = texts.value.recordings.renamed(file, name);
    return '';
  }

  async remove(file: string): Promise<boolean> {
    const reply = await this.ask('recording_delete', {file});
    if (reply === null) return false;
    this.undo.value = {id: text(object(reply)['id']), file};
    this.takePurged(reply);
    await this.refresh();
    return true;
  }

  async restore(id: string): Promise<void> {
    const reply = await this.ask('recording_restore', {id});
    if (reply === null) return;
    this.undo.value = null;
    await this.refresh();
    this.done.value = texts.value.recordings.restored(text(object(reply)['file']));
  }

  async removeForGood(): Promise<void> {
    if ((await this.ask('recordings_purge', {})) === null) return;
    this.undo.value = null;
    await this.refresh();
  }

  private takeProblem(): string {
    const problem = this.problem.value;
    this.problem.value = '';
    return problem;
  }

  private takePurged(reply: Json): void {
    const purged = fieldTexts(object(reply)['purged']);
    if (purged.length > 0) this.purged.value = [...this.purged.value, ...purged];
  }

  private async ask(method: string, request: Json, isQuiet = false): Promise<Json | null> {
    if (!isQuiet) {
      this.done.value = '';
      this.undo.value = null;
    }
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

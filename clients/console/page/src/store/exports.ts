import {signal, type Signal} from '@preact/signals';
import type {CallError} from '../protocol/client';
import {list, number, object, text, texts as strings} from '../protocol/fields';
import type {Json, JsonObject} from '../protocol/json';
import {texts} from '../texts/texts';
import {recallJson, remember} from './kept';
import type {Link} from './link';

/** The part of a recording: all of it, between times, between marks, or trials. */
export type Part =
  | {readonly kind: 'all'}
  | {
      readonly kind: 'times';
      readonly fromS: number | null;
      readonly toS: number | null;
    }
  | {
      readonly kind: 'marks';
      readonly first: string;
      readonly second: string;
    }
  | {
      readonly kind: 'trial';
      readonly number: number;
    }
  | {
      readonly kind: 'condition';
      readonly condition: string;
    };

export interface TableChoice {
  /** One table on one clock; else one for each topic. */
  readonly isJoined: boolean;
  /** Rows per second; null: as recorded. */
  readonly rateHz: number | null;
  /** Patterns of columns; none: all. */
  readonly columns: readonly string[];
  /** Topics; null: all. */
  readonly topics: readonly string[] | null;
  readonly part: Part;
}

/** Topics, trials and marks by which a table can be chosen. */
export interface Contents {
  readonly topics: readonly string[];
  readonly trials: readonly number[];
  readonly conditions: readonly string[];
  readonly marks: readonly string[];
}

/** A file that the console is making. */
export interface Making {
  readonly id: string;
  /** From 0 to 1. */
  readonly part: number;
}

const kKey = 'rtpm.tables';
const kProgressMs = 400;
/** A table of a long recording takes minutes. */
const kMakeTimeoutMs = 24 * 3600 * 1000;

export const kWhole: TableChoice = {
  isJoined: true,
  rateHz: null,
  columns: [],
  topics: null,
  part: {kind: 'all'},
};

function partFields(part: Part): JsonObject {
  switch (part.kind) {
    case 'all':
      return {};
    case 'times':
      return {from_s: part.fromS, to_s: part.toS};
    case 'marks':
      return {between: [part.first, part.second]};
    case 'trial':
      return {trial: part.number};
    case 'condition':
      return {condition: part.condition};
  }
}

/** Downloads of recordings, as they are and as tables. */
export class Exports {
  /** By the recording's file. */
  readonly making: Signal<ReadonlyMap<string, Making>> = signal(new Map());
  private lastId = 0;

  constructor(
    private readonly link: Link,
    private readonly tell: {readonly problem: Signal<string>; readonly done: Signal<string>},
    /** Makes the browser fetch a path of this server. */
    private readonly fetchFile: (path: string, name: string) => void,
  ) {}

  /** The choice that this browser made last, of what any recording has. */
  lastChoice(): TableChoice {
    const kept = object(recallJson(kKey));
    const rateHz = number(kept['rateHz'], 0);
    return {
      ...kWhole,
      isJoined: kept['isJoined'] !== false,
      rateHz: rateHz > 0 ? rateHz : null,
      columns: strings(kept['columns']),
    };
  }

  async contents(file: string): Promise<Contents | null> {
    const reply = await this.ask('download_choices', {file}, 30_000);
    if (reply === null) return null;
    return {
      topics: strings(reply['topics']),
      trials: list(reply['trials']).map((one) => number(one)),
      conditions: strings(reply['conditions']),
      marks: strings(reply['marks']),
    };
  }

  /** Downloads the recording itself. */
  async download(file: string): Promise<void> {
    await this.make(file, {format: 'mcap'});
  }

  async table(file: string, choice: TableChoice): Promise<void> {
    const {isJoined, rateHz, columns} = choice;
    remember(kKey, JSON.stringify({isJoined, rateHz, columns}));
    await this.make(file, {
      format: 'csv',
      joined: isJoined,
      ...(rateHz === null ? {} : {rate_hz: rateHz}),
      ...(columns.length === 0 ? {} : {columns}),
      ...(choice.topics === null ? {} : {topics: choice.topics}),
      ...partFields(choice.part),
    });
  }

  cancel(file: string): void {
    const making = this.making.value.get(file);
    if (making) void this.quiet('download_cancel', {id: making.id});
  }

  private async make(file: string, request: JsonObject): Promise<void> {
    if (this.making.value.has(file)) return;
    const id = `${Date.now()}-${++this.lastId}`;
    this.show(file, {id, part: 0});
    const timer = setInterval(() => void this.look(file, id), kProgressMs);
    this.tell.done.value = '';
    const reply = await this.ask('download', {id, file, ...request}, kMakeTimeoutMs);
    clearInterval(timer);
    this.show(file, null);
    if (reply === null) return;
    const words = texts.value.exports;
    const leftOut = list(reply['left_out']).map((one) => text(object(one)['topic']));
    if (leftOut.length > 0) this.tell.problem.value = words.leftOut(leftOut.join(', '));
    this.tell.done.value = words.made(text(reply['name']));
    this.fetchFile(text(reply['path']), text(reply['name']));
  }

  private async look(file: string, id: string): Promise<void> {
    const reply = await this.quiet('download_progress', {id});
    if (reply === null || this.making.value.get(file)?.id !== id) return;
    this.show(file, {id, part: number(reply['part'])});
  }

  private show(file: string, making: Making | null): void {
    const all = new Map(this.making.value);
    if (making === null) all.delete(file);
    else all.set(file, making);
    this.making.value = all;
  }

  private async ask(method: string, request: Json, timeoutMs: number): Promise<JsonObject | null> {
    try {
      const reply = await this.link.call(`console/${method}`, request, timeoutMs);
      this.tell.problem.value = '';
      return object(reply);
    } catch (error) {
      this.tell.problem.value = (error as CallError).message;
      return null;
    }
  }

  /** A call whose failure tells nothing new. */
  private async quiet(method: string, request: Json): Promise<JsonObject | null> {
    try {
      return object(await this.link.call(`console/${method}`, request));
    } catch {
      return null;
    }
  }
}

/** Clicks a link to the file. */
export function fetchByLink(path: string, name: string): void {
  const link = document.createElement('a');
  link.href = path;
  link.download = name;
  link.click();
}

import {signal, type Signal} from '@preact/signals';
import {number, object, objects, text, texts, whole} from '../protocol/fields';
import type {Json} from '../protocol/json';
import {readAnswer, readValue, wordsOf, type ParameterType, type Value} from '../forms/parameter';
import type {CallConfig} from '../forms/form';
import {texts as shown} from '../texts/texts';

export type CalibrationPhase = 'Running' | 'Prompt' | 'Done' | 'Failed' | 'Kept' | 'Discarded';

export interface Run {
  readonly run: number | bigint;
  readonly name: string;
  readonly phase: CalibrationPhase;
  readonly progress: number;
  readonly prompt: number;
  readonly text: string;
  readonly answers: readonly string[];
  readonly settings: readonly {readonly name: string; readonly value: Value}[];
}

export interface Offer {
  readonly name: string;
  readonly description: string;
}

const kPhases: readonly CalibrationPhase[] = [
  'Running',
  'Prompt',
  'Done',
  'Failed',
  'Kept',
  'Discarded',
];
const kTypes: readonly ParameterType[] = ['Bool', 'Integer', 'Real', 'Text', 'Choice', 'Vector'];
/** The server cancels a run about which nobody asked for 30 s. */
const kAskMs = 200;

export function readRun(reply: Json): Run {
  const fields = object(reply);
  return {
    run: whole(fields['run']),
    name: text(fields['name']),
    phase:
      kPhases.find((one) => one === fields['phase']) ??
      kPhases[number(fields['phase'])] ??
      'Running',
    progress: Math.min(1, Math.max(0, number(fields['progress']))),
    prompt: number(fields['prompt']),
    text: text(fields['text']),
    answers: texts(fields['answers']),
    settings: objects(fields['settings']).map((setting) => {
      const value = object(setting['value']);
      const type = kTypes.find((one) => one === value['type']) ?? kTypes[number(value['type'])];
      return {name: text(setting['name']), value: readValue(type ?? 'Real', value)};
    }),
  };
}

export function isOver(phase: CalibrationPhase): boolean {
  return phase === 'Failed' || phase === 'Kept' || phase === 'Discarded';
}

/** The calibrations of one object, and the run that is going on. */
export class Calibration {
  readonly offers: Signal<readonly Offer[]> = signal([]);
  readonly run: Signal<Run | null> = signal(null);
  readonly problem: Signal<string> = signal('');
  /** The state of the kept result: it outlives the device's server only if it was saved. */
  readonly isSaved: Signal<boolean> = signal(false);
  private timer: ReturnType<typeof setTimeout> | null = null;

  constructor(
    private readonly call: CallConfig,
    private readonly changed: () => void,
  ) {}

  /** Reads what is offered; a run that is going on, from another page perhaps, is taken up. */
  async open(): Promise<void> {
    try {
      const reply = object(await this.call('calibrations', {}));
      this.offers.value = objects(reply['calibrations']).map((one) => ({
        name: text(one['name']),
        description: text(one['description']),
      }));
      const run = whole(reply['run']);
      this.problem.value = '';
      if (run !== 0 && this.run.value === null) await this.ask('calibration', {run});
    } catch (error) {
      this.problem.value = (error as Error).message;
    }
  }

  close(): void {
    if (this.timer !== null) clearTimeout(this.timer);
    this.timer = null;
  }

  async start(name: string): Promise<void> {
    this.run.value = null;
    await this.ask('calibrate', {name});
  }

  async answer(words: string): Promise<void> {
    const run = this.run.value;
    if (run !== null) await this.ask('answer', {run: run.run, prompt: run.prompt, text: words});
  }

  /** Keeps the result, and saves it: otherwise it would be gone when the server restarts. */
  async keep(): Promise<void> {
    this.isSaved.value = false;
    await this.end('keep');
    if (this.run.value?.phase !== 'Kept') return;
    try {
      const answer = readAnswer(await this.call('save', {}));
      this.isSaved.value = answer.outcome === 'Done';
      if (!this.isSaved.value)
        this.problem.value = shown.value.calibration.notSaved(wordsOf(answer));
    } catch (error) {
      this.problem.value = shown.value.calibration.notSaved((error as Error).message);
    }
    this.changed();
  }

  async discard(): Promise<void> {
    await this.end('discard');
  }

  /** Back to the choice. */
  forget(): void {
    this.close();
    this.run.value = null;
    this.problem.value = '';
  }

  private async end(method: string): Promise<void> {
    const run = this.run.value;
    if (run === null) return;
    await this.ask(method, {run: run.run});
    this.changed();
  }

  private async ask(method: string, request: Json): Promise<void> {
    this.close();
    try {
      const reply = await this.call(method, request);
      const answer = readAnswer(reply);
      this.problem.value = answer.outcome === 'Done' ? '' : wordsOf(answer);
      if (answer.outcome === 'Done') this.run.value = readRun(reply);
    } catch (error) {
      this.problem.value = (error as Error).message;
    }
    const run = this.run.value;
    if (run === null || isOver(run.phase)) return;
    this.timer = setTimeout(() => void this.ask('calibration', {run: run.run}), kAskMs);
  }
}

import {computed, signal, type ReadonlySignal, type Signal} from '@preact/signals';
import type {Json} from '../protocol/json';
import {
  isSame,
  readAnswer,
  readParameterList,
  wordsOf,
  writeSetting,
  type Answer,
  type Parameter,
  type ParameterList,
  type Value,
} from './parameter';
import {texts} from '../texts/texts';
import {check, lockOf, valueText} from './validate';

/** Calls a method of an object's configuration, such as `list`. Rejects with an Error. */
export type CallConfig = (method: string, request: Json) => Promise<Json>;

export interface Draft {
  readonly text: string;
  /** The value that the operator saw when the typing began. */
  readonly base: Value;
}

export interface Verdict {
  readonly isGood: boolean;
  readonly words: string;
}

/**
 * The form of one object's parameters. Typed values stay until they are applied or discarded, also
 * while the connection or the device is gone.
 */
export class Form {
  readonly list: Signal<ParameterList | null> = signal(null);
  /** Why the list could not be read; the last one stays. */
  readonly problem: Signal<string> = signal('');
  readonly drafts: Signal<ReadonlyMap<string, Draft>> = signal(new Map());
  /** Refusals of the server, by parameter. */
  readonly refusals: Signal<ReadonlyMap<string, string>> = signal(new Map());
  readonly verdict: Signal<Verdict | null> = signal(null);
  readonly isBusy: Signal<boolean> = signal(false);

  /** Drafts that differ from what the device has, and are valid. */
  readonly changes: ReadonlySignal<readonly Parameter[]> = computed(() =>
    (this.list.value?.parameters ?? []).filter((one) => this.isChanged(one)),
  );
  readonly invalidCount: ReadonlySignal<number> = computed(
    () => (this.list.value?.parameters ?? []).filter((one) => this.problemOf(one) !== null).length,
  );

  constructor(
    readonly name: string,
    private readonly call: CallConfig,
  ) {}

  /** Reads the list anew; drafts stay. */
  async refresh(): Promise<void> {
    try {
      const list = readParameterList(await this.call('list', {}));
      if (list.revision !== this.list.value?.revision || !isAlike(list, this.list.value)) {
        this.list.value = list;
      }
      this.problem.value = '';
    } catch (error) {
      this.problem.value = (error as Error).message;
    }
  }

  draftOf(parameter: Parameter): string {
    return this.drafts.value.get(parameter.name)?.text ?? valueText(parameter.value);
  }

  type(parameter: Parameter, text: string): void {
    const drafts = new Map(this.drafts.value);
    const base = drafts.get(parameter.name)?.base ?? parameter.value;
    if (text === valueText(parameter.value)) drafts.delete(parameter.name);
    else drafts.set(parameter.name, {text, base});
    this.drafts.value = drafts;
    this.refusals.value = without(this.refusals.value, [parameter.name]);
    this.verdict.value = null;
  }

  discard(names: readonly string[] = [...this.drafts.value.keys()]): void {
    this.drafts.value = without(this.drafts.value, names);
    this.refusals.value = without(this.refusals.value, names);
    this.verdict.value = null;
  }

  /** The faults of the draft, before anything is sent. */
  problemOf(parameter: Parameter): string | null {
    const draft = this.drafts.value.get(parameter.name);
    if (draft === undefined) return null;
    const checked = check(parameter, draft.text);
    return checked.isValid ? null : checked.problem;
  }

  /** Another client changed the parameter while something was typed here. */
  conflictOf(parameter: Parameter): string | null {
    const draft = this.drafts.value.get(parameter.name);
    if (draft === undefined || isSame(draft.base, parameter.value)) return null;
    return texts.value.form.changedElsewhere(valueText(draft.base), valueText(parameter.value));
  }

  async apply(): Promise<void> {
    const list = this.list.value;
    const changes = this.changes.value;
    if (list === null || changes.length === 0) return;
    const settings = changes.map((one) => {
      const checked = check(one, this.draftOf(one));
      return writeSetting(one, checked.isValid ? checked.value : one.value);
    });
    const names = changes.map((one) => one.name);
    await this.change('apply', {revision: list.revision, settings}, () => {
      this.discard(names);
      this.tell(true, texts.value.form.applied(names.length, this.name));
    });
  }

  /** Sets parameters to their defaults; without names: all. */
  async reset(names: readonly string[] | null): Promise<void> {
    const list = this.list.value;
    if (list === null) return;
    const request = names === null ? {revision: list.revision} : {revision: list.revision, names};
    await this.change('reset', request, () => {
      this.discard(names ?? undefined);
      this.tell(
        true,
        names === null
          ? texts.value.form.allDefaults
          : texts.value.form.defaults(names.join(', '), names.length),
      );
    });
  }

  async save(): Promise<void> {
    await this.change('save', {}, () => this.tell(true, texts.value.form.saved));
  }

  private isChanged(parameter: Parameter): boolean {
    const draft = this.drafts.value.get(parameter.name);
    if (draft === undefined) return false;
    if (lockOf(parameter, this.list.value?.isActive ?? false) !== null) return false;
    const checked = check(parameter, draft.text);
    return checked.isValid && !isSame(checked.value, parameter.value);
  }

  private async change(method: string, request: Json, done: () => void): Promise<void> {
    this.isBusy.value = true;
    this.refusals.value = new Map();
    try {
      const reply = await this.call(method, request);
      const answer = readAnswer(reply);
      if (answer.outcome === 'Done') {
        await this.refresh();
        done();
      } else {
        await this.refuse(answer);
      }
    } catch (error) {
      this.verdict.value = {isGood: false, words: (error as Error).message};
    } finally {
      this.isBusy.value = false;
    }
  }

  private async refuse(answer: Answer): Promise<void> {
    await this.refresh();
    if (answer.outcome === 'StaleRevision') {
      this.tell(false, texts.value.form.stale);
      return;
    }
    // A refusal of several together names them in its words.
    const words = wordsOf(answer);
    const names =
      answer.parameter !== ''
        ? [answer.parameter]
        : [...this.drafts.value.keys()].filter((name) => words.includes(name));
    this.refusals.value = new Map(names.map((name) => [name, words]));
    this.tell(false, texts.value.form.refused(words));
  }

  private tell(isGood: boolean, words: string): void {
    this.verdict.value = {isGood, words};
  }
}

function without<T>(map: ReadonlyMap<string, T>, names: readonly string[]): ReadonlyMap<string, T> {
  const rest = new Map(map);
  names.forEach((name) => rest.delete(name));
  return rest;
}

/** Whether what can change without a new revision is the same. */
function isAlike(a: ParameterList, b: ParameterList | null): boolean {
  return (
    b !== null &&
    a.isActive === b.isActive &&
    a.isUnsaved === b.isUnsaved &&
    a.isPersistent === b.isPersistent &&
    a.parameters.length === b.parameters.length
  );
}

/** The names of objects that have parameters, by the services that the console offers. */
export function configNames(services: ReadonlySet<string>): string[] {
  const end = '/config/list';
  return [...services]
    .filter((name) => name.endsWith(end))
    .map((name) => name.slice(0, -end.length))
    .sort();
}

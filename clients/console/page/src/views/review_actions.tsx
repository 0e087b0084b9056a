import {useLayoutEffect, useRef, useState} from 'preact/hooks';
import type {Shared} from '../drawing/review_chart';
import {cutName, timeNsAt, withEnding} from '../model/review';
import {lengthOf, momentText, within} from '../model/span';
import {Notice, Problem} from '../parts/parts';
import {duration} from '../parts/text';
import {useApp} from '../store/app';
import {writeRoute} from '../store/route';
import {texts} from '../texts/texts';
import {ExportMenu} from './export_menu';
import type {ShownRun} from './review_charts';

/** A recording and what of it shows. */
export interface PartProps extends ShownRun {
  readonly shared: Shared;
}

/** The actions on a recording; a form opens below the buttons. */
export function Actions({review, run, shared, originS}: PartProps) {
  const app = useApp();
  const words = texts.value.review;
  const [form, setForm] = useState<'none' | 'note' | 'cut' | 'rename'>('none');
  const {recordings} = app;
  const isUsable = app.isLive.value;
  const atS = (shared.pinnedS ?? shared.span.fromS) + originS;
  const toggle = (wanted: 'note' | 'cut' | 'rename') => setForm(form === wanted ? 'none' : wanted);
  const replay = async () => {
    if (!(await recordings.open(run.file))) return;
    await recordings.seek(Number(timeNsAt(run.beginNs, atS)));
    await recordings.play(1);
    app.showsReplay.value = true;
    window.location.hash = writeRoute('live');
  };
  const remove = async () => {
    if (await recordings.remove(run.file)) window.location.hash = writeRoute('recordings');
  };
  const buttons = [
    ['note', words.addNote],
    ['cut', words.cut],
    ['rename', words.rename],
  ] as const;
  return (
    <div class="review-actions" data-testid="review-actions">
      <div class="row">
        <button type="button" disabled={!isUsable} onClick={() => void replay()}>
          {words.replayFrom(momentText(atS, 1))}
        </button>
        {buttons.map(([name, text]) => (
          <button
            key={name}
            type="button"
            disabled={!isUsable}
            aria-expanded={form === name}
            onClick={() => toggle(name)}
          >
            {text}
          </button>
        ))}
        <button type="button" disabled={!isUsable} onClick={() => void remove()}>
          {words.remove}
        </button>
        <ExportMenu file={run.file} />
      </div>
      {recordings.problem.value !== '' && (
        <Notice tone="bad" role="alert">
          {recordings.problem.value}
        </Notice>
      )}
      {form === 'note' && (
        <TextForm
          key="note"
          label={words.noteAt(momentText(atS, 3))}
          value=""
          confirm={words.addNote}
          onCancel={() => setForm('none')}
          onDone={async (text) => {
            const why = await review.annotate(atS, text);
            if (why === '') setForm('none');
            return why;
          }}
        />
      )}
      {form === 'cut' && (
        <CutForm
          review={review}
          run={run}
          shared={shared}
          originS={originS}
          onEnd={() => setForm('none')}
        />
      )}
      {form === 'rename' && (
        <TextForm
          key="rename"
          label={words.newName}
          value={run.file}
          confirm={words.rename}
          onCancel={() => setForm('none')}
          onDone={async (text) => {
            const name = withEnding(text);
            const why = await recordings.rename(run.file, name);
            if (why === '') window.location.hash = writeRoute('recordings', name);
            return why;
          }}
        />
      )}
    </div>
  );
}

interface TextFormProps {
  readonly label: string;
  readonly value: string;
  readonly confirm: string;
  readonly onCancel: () => void;
  /** Returns why it was refused; empty: it is done. */
  readonly onDone: (text: string) => Promise<string>;
}

function TextForm({label, value, confirm, onCancel, onDone}: TextFormProps) {
  const [typed, setTyped] = useState(value);
  const [why, setWhy] = useState('');
  const [isBusy, setBusy] = useState(false);
  const field = useRef<HTMLInputElement>(null);
  // Before the next key, which the button that opened the form would take.
  useLayoutEffect(() => {
    field.current?.focus();
    field.current?.setSelectionRange(0, value.replace(/\.mcap$/, '').length);
  }, []);
  const submit = async (event: Event) => {
    event.preventDefault();
    if (typed.trim() === '' || isBusy) return;
    setBusy(true);
    setWhy(await onDone(typed.trim()));
    setBusy(false);
  };
  return (
    <form class="review-form" onSubmit={(event) => void submit(event)}>
      <label>
        {label}
        <input
          ref={field}
          type="text"
          value={typed}
          maxLength={4000}
          onInput={(event) => setTyped(event.currentTarget.value)}
          onKeyDown={(event) => {
            if (event.key === 'Escape') onCancel();
          }}
        />
      </label>
      <div class="row">
        <button type="submit" class="strong" disabled={isBusy || typed.trim() === ''}>
          {confirm}
        </button>
        <button type="button" onClick={onCancel}>
          {texts.value.parts.cancel}
        </button>
      </div>
      <Problem text={why} />
    </form>
  );
}

function CutForm({review, run, shared, originS, onEnd}: PartProps & {onEnd: () => void}) {
  const app = useApp();
  const words = texts.value.review;
  const taken = new Set((app.recordings.entries.value ?? []).map((one) => one.file));
  const part = within(
    {fromS: shared.span.fromS + originS, toS: shared.span.toS + originS},
    {fromS: 0, toS: Math.max(run.lengthS, 1e-3)},
  );
  const what = words.cutPart(
    momentText(part.fromS, 3),
    momentText(part.toS, 3),
    duration(lengthOf(part)),
  );
  return (
    <>
      {run.cut !== null && (
        <p role="status">{words.cutting(run.cut.file, Math.round(100 * run.cut.progress))}</p>
      )}
      <TextForm
        label={what}
        value={cutName(run.file, taken)}
        confirm={words.cut}
        onCancel={onEnd}
        onDone={async (text) => {
          try {
            const made = await review.cut(part, withEnding(text));
            app.recordings.done.value = words.cutDone(made);
            await app.recordings.refresh();
            onEnd();
            return '';
          } catch (error) {
            return (error as Error).message;
          }
        }}
      />
    </>
  );
}

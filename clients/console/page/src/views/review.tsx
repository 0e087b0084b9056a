import {signal, useSignal} from '@preact/signals';
import {useEffect, useLayoutEffect, useMemo, useRef, useState} from 'preact/hooks';
import {kShapes} from '../drawing/marks';
import {OverviewStrip, ReviewChart, type Shared} from '../drawing/review_chart';
import {boundsOf, boundsOfAll} from '../model/points';
import {
  byUnit,
  commonLabels,
  cutName,
  firstFields,
  originOf,
  search,
  secondsSince,
  timeNsAt,
  withEnding,
  type Happening,
  type HappeningKind,
  type ReviewField,
  type Run,
} from '../model/review';
import {centred, lengthOf, momentText, within, zoomed, type Span} from '../model/span';
import {Badge, Card, Empty, Notice, Problem} from '../parts/parts';
import {bytes, dayAndTime, duration, thousands, timeOfDay} from '../parts/text';
import {useApp} from '../store/app';
import {texts as strings} from '../protocol/fields';
import {recallJson, remember} from '../store/kept';
import {Review} from '../store/review';
import {writeRoute} from '../store/route';
import {texts} from '../texts/texts';
import {ExportMenu} from './export_menu';

const kFieldsKey = 'rtpm.review.fields';
const kPointMax = 1500;
const kStripPoints = 1000;
const kWholeOfNothing: Span = {fromS: 0, toS: 1};

/** The fields that are shown, by the choice of this browser; null: none was chosen yet. */
const chosen = signal<readonly string[] | null>(readChosen());

function readChosen(): readonly string[] | null {
  const kept = recallJson(kFieldsKey);
  return Array.isArray(kept) ? strings(kept) : null;
}

function choose(fields: readonly string[]): void {
  chosen.value = fields;
  remember(kFieldsKey, JSON.stringify(fields));
}

/** The recording that the file's name tells; it follows the connection. */
function useReview(file: string | null): Review | null {
  const app = useApp();
  const review = useMemo(
    () => (file === null ? null : new Review(app.link, file)),
    [app.link, file],
  );
  const hasService = app.link.services.value.has('console/review_open');
  useEffect(() => {
    if (hasService) void review?.open();
  }, [review, hasService]);
  useEffect(() => () => review?.end(), [review]);
  return review;
}

function Mark({kind}: {kind: HappeningKind}) {
  const {path, paint} = kShapes[kind];
  return (
    <svg class="review-mark" viewBox="-8 -8 16 16" aria-hidden="true">
      <path d={path} style={{fill: `var(--${paint})`}} />
    </svg>
  );
}

/** A whole recording at a glance, and every part of it. */
export function ReviewView({file, atNs}: {file: string; atNs: bigint | null}) {
  const app = useApp();
  const words = texts.value.review;
  const review = useReview(file);
  const run = review?.run.value ?? null;
  const other = useSignal<string | null>(null);
  const label = useSignal('');
  const second = useReview(other.value);
  const secondRun = second?.run.value ?? null;
  const [origin, secondOrigin] = originsOf(run, secondRun, label.value);
  const whole = wholeOf(run, origin, secondRun, secondOrigin);
  const wanted = useSignal<Span | null>(null);
  const hoverS = useSignal<number | null>(null);
  const pinnedS = useSignal<number | null>(null);
  const brushed = useSignal<Span | null>(null);
  const span = wanted.value === null ? whole : within(wanted.value, whole);
  const shared: Shared = {
    span,
    whole,
    hoverS: hoverS.value,
    pinnedS: pinnedS.value,
    brushed: brushed.value,
    setSpan: (to) => (wanted.value = within(to, whole)),
    hover: (to) => (hoverS.value = to),
    pin: (to) => (pinnedS.value = to),
    brush: (to) => (brushed.value = to),
    reset: () => (wanted.value = null),
  };
  // A link to a moment shows it, with ten seconds around it.
  const isThere = run !== null;
  useEffect(() => {
    if (run === null || atNs === null) return;
    const atS = secondsSince(run.beginNs, atNs);
    pinnedS.value = atS;
    wanted.value = centred({fromS: 0, toS: Math.min(10, run.lengthS)}, atS, whole);
  }, [isThere, atNs]);
  const goTo = (atS: number) => {
    pinnedS.value = atS;
    if (atS < span.fromS || atS > span.toS) shared.setSpan(centred(span, atS, whole));
  };

  if (!app.link.services.value.has('console/review_open')) {
    return <Empty>{words.noService}</Empty>;
  }
  return (
    <div class="review">
      <ReviewHead file={file} run={run} />
      {review !== null && <ReviewProblems review={review} />}
      {run !== null && review !== null && (
        <>
          <Actions review={review} run={run} shared={shared} originS={origin} />
          <Card title={words.runTitle} class="review-whole">
            <Strip review={review} run={run} shared={shared} originS={origin} />
            {second !== null && secondRun !== null && (
              <Strip review={second} run={secondRun} shared={shared} originS={secondOrigin} />
            )}
            {second !== null && <ReviewProblems review={second} />}
            <SpanBar shared={shared} originS={origin} run={run} />
            <Compare
              file={file}
              run={run}
              second={secondRun}
              other={other.value}
              label={label.value}
              onOther={(to) => {
                other.value = to;
                label.value = '';
                wanted.value = null;
              }}
              onLabel={(to) => {
                label.value = to;
                wanted.value = null;
              }}
            />
          </Card>
          <div class="review-body">
            <Charts
              runs={[
                {review, run, originS: origin},
                ...(second !== null && secondRun !== null
                  ? [{review: second, run: secondRun, originS: secondOrigin}]
                  : []),
              ]}
              shared={shared}
            />
            <Happenings
              review={review}
              run={run}
              originS={origin}
              span={span}
              onGo={(atS) => goTo(atS - origin)}
            />
          </div>
        </>
      )}
      {run === null && review?.problem.value === '' && <Empty>{words.opening}</Empty>}
    </div>
  );
}

function originsOf(run: Run | null, second: Run | null, label: string): [number, number] {
  if (run === null || second === null) return [0, 0];
  const both = [originOf(run, label), originOf(second, label)] as const;
  return both[0] === null || both[1] === null ? [0, 0] : [both[0], both[1]];
}

function wholeOf(run: Run | null, origin: number, second: Run | null, secondOrigin: number): Span {
  if (run === null) return kWholeOfNothing;
  const least = 1e-3;
  const whole = {fromS: -origin, toS: Math.max(run.lengthS, least) - origin};
  if (second === null) return whole;
  return {
    fromS: Math.min(whole.fromS, -secondOrigin),
    toS: Math.max(whole.toS, second.lengthS - secondOrigin),
  };
}

const kSessionFirst = ['participant', 'experiment', 'condition'];

function ReviewHead({file, run}: {file: string; run: Run | null}) {
  const words = texts.value.review;
  const session = run?.session ?? [];
  const facts = kSessionFirst
    .map((name) => session.find(([key]) => key === name)?.[1] ?? '')
    .filter((one) => one !== '');
  return (
    <header class="review-head">
      <a class="review-back" href={writeRoute('recordings')}>
        ← {texts.value.views.recordings}
      </a>
      <h2>{file}</h2>
      {run !== null && !run.isComplete && <Badge tone="warn">{words.notEnded}</Badge>}
      {facts.map((one) => (
        <Badge key={one} tone="accent">
          {one}
        </Badge>
      ))}
      {run !== null && (
        <p class="quiet">
          {dayAndTime(Number(run.beginNs / 1_000_000n))} · {duration(run.lengthS)} ·{' '}
          {words.messages(thousands(run.messageCount))}
        </p>
      )}
    </header>
  );
}

function ReviewProblems({review}: {review: Review}) {
  const words = texts.value.review;
  const run = review.run.value;
  const told = [review.problem.value, run?.problem ?? '', run?.notesProblem ?? ''].filter(
    (one, i, all) => one !== '' && all.indexOf(one) === i,
  );
  return (
    <>
      {told.map((one) => (
        <Notice key={one} tone="bad" role="alert">
          {review.file}: {one}
        </Notice>
      ))}
      {run !== null && !run.isComplete && <Notice tone="warn">{words.notEndedText}</Notice>}
      {run !== null && run.omittedFieldCount > 0 && (
        <Notice tone="warn">{words.omittedFields(run.omittedFieldCount)}</Notice>
      )}
      {run !== null && run.unreadableTopics.length > 0 && (
        <Notice tone="warn">{words.unreadable(run.unreadableTopics.join(', '))}</Notice>
      )}
    </>
  );
}

interface PartProps {
  readonly review: Review;
  readonly run: Run;
  readonly shared: Shared;
  readonly originS: number;
}

/** The actions on a recording; a form opens below the buttons. */
function Actions({review, run, shared, originS}: PartProps) {
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

function Strip({review, run, shared, originS}: PartProps) {
  const path = shownFields(run)[0] ?? '';
  useEffect(() => {
    const whole = {fromS: 0, toS: Math.max(run.lengthS, 1e-3)};
    review.show('overview', path === '' ? [] : [path], whole, kStripPoints);
  }, [review, path, run.lengthS]);
  return (
    <OverviewStrip
      shared={shared}
      originS={originS}
      name={run.file}
      lengthS={run.lengthS}
      progress={run.progress}
      field={run.fields.find((one) => one.path === path) ?? null}
      curve={review.overview.value?.byField.get(path) ?? null}
      happenings={[...run.happenings, ...run.notes]}
    />
  );
}

function SpanBar({shared, originS, run}: {shared: Shared; originS: number; run: Run}) {
  const words = texts.value.review;
  const {span, whole} = shared;
  const middleS = shared.pinnedS ?? (span.fromS + span.toS) / 2;
  const atS = shared.hoverS ?? shared.pinnedS;
  const isWhole = lengthOf(span) >= 0.999_999 * lengthOf(whole);
  return (
    <div class="review-bar">
      <output data-testid="review-span">
        {momentText(span.fromS + originS, 3)} – {momentText(span.toS + originS, 3)}{' '}
        <span class="quiet">({duration(lengthOf(span))})</span>
      </output>
      <output class="review-at" data-testid="review-at">
        {atS === null
          ? words.hint
          : `${momentText(atS + originS, 4)} · ${timeOfDay(
              Number(timeNsAt(run.beginNs, atS + originS) / 1_000_000n),
            )}`}
      </output>
      <div class="row">
        <button
          type="button"
          aria-label={words.zoomIn}
          title={words.zoomIn}
          onClick={() => shared.setSpan(zoomed(span, 0.5, middleS, whole))}
        >
          +
        </button>
        <button
          type="button"
          aria-label={words.zoomOut}
          title={words.zoomOut}
          disabled={isWhole}
          onClick={() => shared.setSpan(zoomed(span, 2, middleS, whole))}
        >
          −
        </button>
        <button type="button" disabled={isWhole} onClick={() => shared.setSpan(whole)}>
          {words.showAll}
        </button>
      </div>
    </div>
  );
}

interface CompareProps {
  readonly file: string;
  readonly run: Run;
  readonly second: Run | null;
  readonly other: string | null;
  readonly label: string;
  readonly onOther: (file: string | null) => void;
  readonly onLabel: (label: string) => void;
}

function Compare({file, run, second, other, label, onOther, onLabel}: CompareProps) {
  const app = useApp();
  const words = texts.value.review;
  const hasList = app.recordings.entries.value !== null;
  const hasService = app.link.services.value.has('console/recordings');
  useEffect(() => {
    if (!hasList && hasService) void app.recordings.refresh();
  }, [hasList, hasService]);
  const others = (app.recordings.entries.value ?? []).filter((one) => one.file !== file);
  const labels = second === null ? [] : commonLabels(run, second);
  return (
    <div class="review-compare">
      <label>
        {words.compare}
        <select
          value={other ?? ''}
          onChange={(event) => onOther(event.currentTarget.value || null)}
        >
          <option value="">{words.compareNone}</option>
          {others.map((one) => (
            <option key={one.file} value={one.file}>
              {one.file} ({bytes(one.byteCount)})
            </option>
          ))}
        </select>
      </label>
      {second !== null && (
        <label>
          {words.alignAt}
          <select value={label} onChange={(event) => onLabel(event.currentTarget.value)}>
            <option value="">{words.alignBegin}</option>
            {labels.map((one) => (
              <option key={one} value={one}>
                {one}
              </option>
            ))}
          </select>
        </label>
      )}
    </div>
  );
}

/** The chosen fields that the recording has; until some are chosen, those of its first device. */
function shownFields(run: Run): readonly string[] {
  const known = new Set(run.fields.map((one) => one.path));
  const kept = (chosen.value ?? []).filter((path) => known.has(path));
  return kept.length > 0 || chosen.value?.length === 0 ? kept : firstFields(run.fields);
}

interface ShownRun {
  readonly review: Review;
  readonly run: Run;
  readonly originS: number;
}

function Charts({runs, shared}: {runs: readonly ShownRun[]; shared: Shared}) {
  const words = texts.value.review;
  const first = runs[0]?.run;
  const holder = useRef<HTMLDivElement>(null);
  const paths = first === undefined ? [] : shownFields(first);
  const key = paths.join('\n');
  const {fromS, toS} = shared.span;
  useEffect(() => {
    const points = Math.min(kPointMax, Math.max(200, holder.current?.clientWidth ?? kPointMax));
    for (const {review, run, originS} of runs) {
      const fields = paths.filter((path) => run.fields.some((one) => one.path === path));
      const whole = {fromS: 0, toS: Math.max(run.lengthS, 1e-3)};
      const wanted = {fromS: fromS + originS, toS: toS + originS};
      const isApart = wanted.toS <= whole.fromS || wanted.fromS >= whole.toS;
      review.show('curves', isApart ? [] : fields, within2(wanted, whole), points);
    }
  }, [key, fromS, toS, runs.length, ...runs.map((one) => one.originS)]);
  const fields = (first?.fields ?? []).filter((one) => paths.includes(one.path));
  const sorted = [...fields].sort((a, b) => paths.indexOf(a.path) - paths.indexOf(b.path));
  const isCoarse = runs.some(
    ({review}) => review.curves.value !== null && !review.curves.value.isExact,
  );
  return (
    <Card
      title={words.charts}
      aside={
        <span class="quiet" role="status" data-testid="review-exact">
          {runs.some(({review}) => review.isReading.value)
            ? words.reading
            : isCoarse
              ? words.coarse
              : words.exact}
        </span>
      }
      class="review-charts"
    >
      {first !== undefined && (
        <Picker fields={first.fields} shown={paths} onChange={(to) => choose(to)} />
      )}
      <div ref={holder}>
        {byUnit(sorted).map((group) => (
          <Group key={group[0]?.unit} group={group} runs={runs} shared={shared} shown={paths} />
        ))}
        {paths.length === 0 && <Empty>{words.noFields}</Empty>}
      </div>
    </Card>
  );
}

/** The part of `span` that is inside; at least something. */
function within2(span: Span, whole: Span): Span {
  return {fromS: Math.max(span.fromS, whole.fromS), toS: Math.min(span.toS, whole.toS)};
}

interface GroupProps {
  readonly group: readonly ReviewField[];
  readonly runs: readonly ShownRun[];
  readonly shared: Shared;
  readonly shown: readonly string[];
}

/** A unit's chart of each recording, one above the other, with the same scale. */
function Group({group, runs, shared, shown}: GroupProps) {
  const range = boundsOfAll(
    runs.flatMap(({review, originS}) =>
      group.map(({path}) => {
        const curve = review.curves.value?.byField.get(path);
        const {fromS, toS} = shared.span;
        return curve === undefined ? null : boundsOf(curve, fromS + originS, toS + originS);
      }),
    ),
  );
  return (
    <>
      {runs.map(({review, run, originS}) => (
        <div key={run.file} class="review-group">
          {runs.length > 1 && <p class="review-run">{run.file}</p>}
          <ReviewChart
            shared={shared}
            originS={originS}
            name={run.file}
            fields={group}
            curves={review.curves.value?.byField ?? new Map()}
            range={range}
            happenings={happeningsOf(review, run)}
            onRemove={(path) => choose(shown.filter((one) => one !== path))}
          />
        </div>
      ))}
    </>
  );
}

/** All happenings of the part that shows, where the file was read. */
function happeningsOf(review: Review, run: Run): readonly Happening[] {
  const curves = review.curves.value;
  const all = curves?.isExact === true ? curves.happenings : run.happenings;
  return [...all, ...run.notes];
}

const kFoundMax = 60;

interface PickerProps {
  readonly fields: readonly ReviewField[];
  readonly shown: readonly string[];
  readonly onChange: (shown: readonly string[]) => void;
}

function Picker({fields, shown, onChange}: PickerProps) {
  const words = texts.value.review;
  const typed = useSignal('');
  const isOpen = useSignal(false);
  const found = search(fields, typed.value, kFoundMax);
  const toggle = (path: string) =>
    onChange(shown.includes(path) ? shown.filter((one) => one !== path) : [...shown, path]);
  return (
    <details
      class="review-picker"
      open={isOpen.value}
      onToggle={(event) => (isOpen.value = event.currentTarget.open)}
    >
      <summary>{words.chooseFields(shown.length, fields.length)}</summary>
      <input
        type="search"
        placeholder={words.searchFields}
        aria-label={words.searchFields}
        value={typed.value}
        onInput={(event) => (typed.value = event.currentTarget.value)}
      />
      <ul>
        {found.map(({path, unit}) => (
          <li key={path}>
            <label>
              <input type="checkbox" checked={shown.includes(path)} onChange={() => toggle(path)} />{' '}
              {path} {unit !== '' && <span class="quiet">[{unit}]</span>}
            </label>
          </li>
        ))}
      </ul>
      {found.length === kFoundMax && <p class="quiet">{words.moreFields}</p>}
      {found.length === 0 && <p class="quiet">{words.noneFound}</p>}
    </details>
  );
}

const kKinds: readonly HappeningKind[] = [
  'marker',
  'trial',
  'note',
  'fault',
  'stop',
  'lost',
  'lease',
];
const kRowMax = 200;

interface HappeningsProps {
  readonly review: Review;
  readonly run: Run;
  readonly originS: number;
  readonly span: Span;
  readonly onGo: (atS: number) => void;
}

/** A happening, in words; a press goes there. */
function Happenings({review, run, originS, span, onGo}: HappeningsProps) {
  const words = texts.value.review;
  const hidden = useSignal<readonly HappeningKind[]>(['lease']);
  const problem = useSignal('');
  const all = [...run.happenings, ...run.notes].sort((a, b) => a.atS - b.atS);
  const kinds = kKinds.filter((kind) => all.some((one) => one.kind === kind));
  const rows = all.filter((one) => !hidden.value.includes(one.kind));
  // Those of the part that shows come first to hand.
  const inside = rows.filter(
    (one) => one.atS >= span.fromS + originS && one.atS <= span.toS + originS,
  );
  const thinned = run.counts.markers + run.counts.trials + run.counts.incidents;
  const remove = async (note: Happening) => {
    problem.value = await review.removeNote(note);
  };
  return (
    <Card
      title={words.happenings}
      aside={
        <span class="quiet">{words.ofAll(thousands(inside.length), thousands(rows.length))}</span>
      }
      class="review-happenings"
    >
      {kinds.length > 0 && (
        <div class="review-kinds" role="group" aria-label={words.kindsLabel}>
          {kinds.map((kind) => (
            <button
              key={kind}
              type="button"
              aria-pressed={!hidden.value.includes(kind)}
              onClick={() =>
                (hidden.value = hidden.value.includes(kind)
                  ? hidden.value.filter((one) => one !== kind)
                  : [...hidden.value, kind])
              }
            >
              <Mark kind={kind} />
              {words[kind]}
            </button>
          ))}
        </div>
      )}
      {thinned > run.happenings.length && (
        <p class="warn-text">
          {words.thinned(thousands(run.happenings.length), thousands(thinned))}
        </p>
      )}
      <Problem text={problem.value} />
      {inside.length === 0 ? (
        <Empty>{all.length === 0 ? words.nothingHappened : words.nothingHere}</Empty>
      ) : (
        <ol class="review-list" data-testid="review-happenings">
          {inside.slice(0, kRowMax).map((one) => (
            <li key={`${one.kind} ${one.timeNs} ${one.device} ${one.text}`}>
              <button type="button" onClick={() => onGo(one.atS)}>
                <Mark kind={one.kind} />
                <span class="review-time">{momentText(one.atS, 3)}</span>
                <span>{happeningText(one)}</span>
              </button>
              {one.kind === 'note' && (
                <button
                  type="button"
                  class="review-remove"
                  aria-label={words.removeNote(one.text)}
                  title={words.removeNote(one.text)}
                  onClick={() => void remove(one)}
                >
                  ×
                </button>
              )}
            </li>
          ))}
        </ol>
      )}
      {inside.length > kRowMax && (
        <p class="quiet">{words.moreHappenings(inside.length - kRowMax)}</p>
      )}
    </Card>
  );
}

/** "Fault of lab/arm0: force clamped (0.2 s)" */
function happeningText(one: Happening): string {
  const words = texts.value.review;
  const lastedS = (one.endS ?? one.atS) - one.atS;
  const isEndless = one.kind === 'trial' && one.endS === null;
  const length = isEndless ? ` ${words.endless}` : lastedS > 0 ? ` (${duration(lastedS)})` : '';
  if (one.kind === 'trial') {
    return `${words.trial} ${one.number}${one.text === '' ? '' : `: ${one.text}`}${length}`;
  }
  const subject = one.device === '' ? words[one.kind] : `${words[one.kind]}, ${one.device}`;
  return `${subject}: ${one.text}${length}`;
}

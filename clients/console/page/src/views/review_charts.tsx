import {signal, useSignal} from '@preact/signals';
import {useEffect, useRef} from 'preact/hooks';
import {ReviewChart, type Shared} from '../drawing/review_chart';
import {boundsOf, boundsOfAll} from '../model/points';
import {
  byUnit,
  firstFields,
  search,
  type Happening,
  type ReviewField,
  type Run,
} from '../model/review';
import type {Span} from '../model/span';
import {Card, Empty} from '../parts/parts';
import {texts as strings} from '../protocol/fields';
import {recallJson, remember} from '../store/kept';
import {Review} from '../store/review';
import {texts} from '../texts/texts';

const kFieldsKey = 'rtpm.review.fields';
const kPointMax = 1500;
const kFoundMax = 60;

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

/** The chosen fields that the recording has; until some are chosen, those of its first device. */
export function shownFields(run: Run): readonly string[] {
  const known = new Set(run.fields.map((one) => one.path));
  const kept = (chosen.value ?? []).filter((path) => known.has(path));
  return kept.length > 0 || chosen.value?.length === 0 ? kept : firstFields(run.fields);
}

/** A recording that shows, and where it stands on the axis. */
export interface ShownRun {
  readonly review: Review;
  readonly run: Run;
  readonly originS: number;
}

export function Charts({runs, shared}: {runs: readonly ShownRun[]; shared: Shared}) {
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
      review.show('curves', isApart ? [] : fields, overlap(wanted, whole), points);
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

/** The part of `span` that is in `whole`; both have a moment in common. */
function overlap(span: Span, whole: Span): Span {
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

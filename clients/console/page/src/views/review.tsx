import {useSignal} from '@preact/signals';
import {useEffect, useMemo} from 'preact/hooks';
import {OverviewStrip, type Shared} from '../drawing/review_chart';
import {commonLabels, originOf, secondsSince, timeNsAt, type Run} from '../model/review';
import {centred, lengthOf, momentText, within, zoomed, type Span} from '../model/span';
import {Badge, Card, Empty, Notice} from '../parts/parts';
import {bytes, dayAndTime, duration, thousands, timeOfDay} from '../parts/text';
import {useApp} from '../store/app';
import {Review} from '../store/review';
import {writeRoute} from '../store/route';
import {texts} from '../texts/texts';
import {Actions, type PartProps} from './review_actions';
import {Charts, shownFields} from './review_charts';
import {Happenings} from './review_happenings';

const kStripPoints = 1000;
const kWholeOfNothing: Span = {fromS: 0, toS: 1};

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

import {useSignal} from '@preact/signals';
import {kShapes} from '../drawing/marks';
import {mostTelling, type Happening, type HappeningKind, type Run} from '../model/review';
import {momentText, type Span} from '../model/span';
import {Card, Empty, Problem} from '../parts/parts';
import {duration, thousands} from '../parts/text';
import {Review} from '../store/review';
import {texts} from '../texts/texts';

function Mark({kind}: {kind: HappeningKind}) {
  const {path, paint} = kShapes[kind];
  return (
    <svg class="review-mark" viewBox="-8 -8 16 16" aria-hidden="true">
      <path d={path} style={{fill: `var(--${paint})`}} />
    </svg>
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
export function Happenings({review, run, originS, span, onGo}: HappeningsProps) {
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
  const shown = mostTelling(inside, kRowMax);
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
          {shown.map((one) => (
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
      {inside.length > shown.length && (
        <p class="quiet">{words.moreHappenings(inside.length - shown.length)}</p>
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

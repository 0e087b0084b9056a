import type {Happening, HappeningKind} from '../model/review';
import type {Span} from '../model/span';
import type {MarkerList} from '../store/markers';
import {colour} from '../store/theme';
import {line, xOf, type Frame} from './canvas';

/** Moments and intervals over charts: markers, trials, notes, incidents. */

export type Mark = Pick<Happening, 'kind' | 'atS' | 'endS' | 'text' | 'number'>;

/** Each has a shape of its own, so that its colour says nothing alone. Paths around 0, 6 px wide. */
export const kShapes: Readonly<Record<HappeningKind, {path: string; paint: string}>> = {
  marker: {path: 'M-4 -6L5.5 -2.5L-2 .5V6H-4Z', paint: 'accent'},
  trial: {path: 'M-6 -3H6V3H-6Z', paint: 'replay'},
  note: {path: 'M-5 -5H5V2H1L-2 6V2H-5Z', paint: 'good'},
  fault: {path: 'M0 -6L6 5H-6Z', paint: 'bad'},
  stop: {path: 'M-2.3 -5.5H2.3L5.5 -2.3V2.3L2.3 5.5H-2.3L-5.5 2.3V-2.3Z', paint: 'stop'},
  lost: {path: 'M-5 -3L-3 -5L0 -2L3 -5L5 -3L2 0L5 3L3 5L0 2L-3 5L-5 3L-2 0Z', paint: 'bad'},
  lease: {path: 'M0 -5.5L5.5 0L0 5.5L-5.5 0Z', paint: 'quiet'},
};
const kLabelMax = 24;
/** Moments that are nearer have one label. */
const kSamePx = 4;

/** Whether any of it is in the part that shows. */
export function isWithin({atS, endS, kind}: Mark, {fromS, toS}: Span): boolean {
  return atS <= toS && (kind === 'trial' ? (endS ?? Infinity) : atS) >= fromS;
}

/** Those of the live system or of a replay in a part of the time, whose clock is ahead by `offsetS`. */
export function marksOf(list: MarkerList, offsetS: number, span: Span): Mark[] {
  const atS = (ns: number) => ns / 1e9 + offsetS;
  const trials = list.trials.peek().map((one): Mark => ({
    kind: 'trial',
    atS: atS(one.beginNs),
    endS: one.endNs === null ? null : atS(one.endNs),
    text: [one.condition, one.response].filter((part) => part !== '').join(' → '),
    number: one.number,
  }));
  const markers = list.rows
    .peek()
    .filter(({timeNs}) => atS(timeNs) >= span.fromS && atS(timeNs) <= span.toS)
    .map(({timeNs, label, number}): Mark => ({
      kind: 'marker',
      atS: atS(timeNs),
      endS: null,
      text: label,
      number,
    }));
  return [...trials, ...markers];
}

/** Trials as bands behind the curves, with their numbers. */
export function drawTrials(frame: Frame, marks: readonly Mark[]): void {
  const {context, left, top, width, height} = frame;
  context.textBaseline = 'bottom';
  context.textAlign = 'left';
  context.lineWidth = 1;
  for (const one of marks) {
    if (one.kind !== 'trial' || !isWithin(one, frame.span)) continue;
    const from = Math.max(xOf(frame, one.atS), left - 1);
    const to = Math.min(one.endS === null ? Infinity : xOf(frame, one.endS), left + width + 1);
    context.fillStyle = colour('replay-soft');
    context.globalAlpha = 0.6;
    context.fillRect(from, top, Math.max(to - from, 2), height);
    context.globalAlpha = 1;
    context.strokeStyle = context.fillStyle = colour('replay');
    for (const x of [from, to]) line(frame, x, top, x, top + height);
    const text = [`${one.number} ${one.text}`.trim(), String(one.number)].find(
      (name) => context.measureText(name).width <= to - from - 8,
    );
    if (text !== undefined) context.fillText(text, from + 4, top + height - 2);
  }
}

/** Moments as lines with their symbols above; a label that has no room is left out. */
export function drawMoments(frame: Frame, marks: readonly Mark[]): void {
  const {context, left, top, width, height} = frame;
  const moments = marks
    .filter((one) => one.kind !== 'trial' && isWithin(one, frame.span))
    .map((one) => ({...one, x: xOf(frame, one.atS)}))
    .sort((a, b) => a.x - b.x);
  context.lineWidth = 1;
  context.textBaseline = 'middle';
  context.textAlign = 'left';
  let before = -Infinity;
  moments.forEach(({kind, text, x}, i) => {
    const {path, paint} = kShapes[kind];
    context.strokeStyle = context.fillStyle = colour(paint);
    line(frame, x, top, x, top + height);
    const label = text.length > kLabelMax ? `${text.slice(0, kLabelMax - 1)}…` : text;
    let next = i + 1;
    while ((moments[next]?.x ?? Infinity) < x + kSamePx) ++next;
    const end = (moments[next]?.x ?? left + width + 8) - 8;
    const hasRoom = x - before >= kSamePx && x + 9 + context.measureText(label).width <= end;
    if (hasRoom) context.fillText(label, x + 9, top - 10);
    before = x;
    const shape = new Path2D(path);
    context.save();
    context.translate(x, top - 10);
    context.strokeStyle = colour('surface');
    context.fill(shape);
    context.stroke(shape);
    context.restore();
  });
}

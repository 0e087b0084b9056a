import type {ReadonlySignal} from '@preact/signals';
import {boundsText, numberText} from '../model/axis';
import {subjectOf} from '../model/fields';
import type {Plot} from '../model/layout';
import {boundsOf, valueAt} from '../model/points';
import {kStaleMs} from '../model/state';
import type {Field} from '../store/plot_data';
import {texts} from '../texts/texts';
import {curveColour, isDashed, type Scene} from './scene';

/** The values of a plot as a table, and its alarms in words. */

export interface LegendProps {
  readonly plot: Plot;
  readonly title: string;
  readonly nowMs: () => number;
  readonly isLive: () => boolean;
  readonly onRemove: (path: string) => void;
}

/** A row of the table. */
export interface Row {
  readonly value: string;
  readonly low: string;
  readonly high: string;
}

const kNoValues: Row = {value: '–', low: '–', high: '–'};

function isFresh({isLive, nowMs}: Pick<LegendProps, 'nowMs' | 'isLive'>, field: Field): boolean {
  return isLive() && nowMs() - field.cameMs <= kStaleMs;
}

/** The values at the crosshair, else the newest. */
export function rowOf(
  props: Pick<LegendProps, 'nowMs' | 'isLive'>,
  field: Field | null,
  {lines, axes, crossS, span}: Scene,
  at: number,
  isFollowing: boolean,
): Row {
  const line = lines[at];
  const scale = axes[line?.axis ?? -1]?.scale;
  if (field === null || line === undefined || scale === undefined) return kNoValues;
  const isNow = crossS === null && isFollowing;
  const newest = field.ring.valueAt(field.ring.size - 1);
  const value =
    isNow && isFresh(props, field)
      ? {low: newest, high: newest}
      : // An old value is not shown as if it were new.
        isNow && field.ring.size > 0
        ? null
        : valueAt(line.points, crossS ?? span.toS);
  const bounds = boundsOf(line.points, span.fromS, span.toS);
  return {
    value: boundsText(value, scale),
    low: bounds === null ? '–' : numberText(bounds.low, scale),
    high: bounds === null ? '–' : numberText(bounds.high, scale),
  };
}

/** The thresholds that newest values pass, in words. */
export function passedOf(
  props: Omit<LegendProps, 'title' | 'onRemove'>,
  fields: readonly (Field | null)[],
  {lines, axes}: Omit<Scene, 'crossS'>,
): string[] {
  const words = texts.peek().plots;
  return fields.flatMap((field, i) => {
    const scale = axes[lines[i]?.axis ?? 0]?.scale;
    if (field === null || scale === undefined || !isFresh(props, field)) return [];
    const newest = field.ring.valueAt(field.ring.size - 1);
    return props.plot.thresholds
      .filter(({unit}) => unit === field.unit)
      .filter(({side, value}) => (side === 'above' ? newest > value : newest < value))
      .map(({side, value, label}) => {
        const limit = `${numberText(value, scale)} ${scale.unit}`;
        const name = label === '' ? limit : `${label} (${limit})`;
        return words[side === 'above' ? 'isAbove' : 'isBelow'](field.path, name);
      });
  });
}

export function Alarm({alarm}: {alarm: ReadonlySignal<string>}) {
  return (
    <p class="plot-alarms" role="status" hidden={alarm.value === ''}>
      {alarm.value === '' ? '' : `⚠ ${alarm.value}`}
    </p>
  );
}

export function Legend({
  plot,
  title,
  onRemove,
  rows,
}: LegendProps & {readonly rows: ReadonlySignal<readonly Row[]>}) {
  const words = texts.value.plots;
  return (
    <div class="scroll">
      <table class="plot-legend">
        <caption class="visually-hidden">{words.legend(title)}</caption>
        <thead>
          <tr>
            <th scope="col">{words.curve}</th>
            {[words.value, words.lowest, words.highest].map((name) => (
              <th key={name} scope="col" class="number">
                {name}
              </th>
            ))}
            <th scope="col">
              <span class="visually-hidden">{words.remove}</span>
            </th>
          </tr>
        </thead>
        <tbody>
          {plot.fields.map((path, i) => (
            <tr key={path} data-curve={path}>
              <th scope="row">
                <i
                  class={isDashed(i) ? 'is-dashed' : ''}
                  style={{'--paint': `var(--${curveColour(i)})`}}
                />
                <span class="quiet">{subjectOf(path)} </span>
                {path.slice(subjectOf(path).length + 1)}
              </th>
              <td class="number" data-value>
                {rows.value[i]?.value}
              </td>
              <td class="number" data-low>
                {rows.value[i]?.low}
              </td>
              <td class="number" data-high>
                {rows.value[i]?.high}
              </td>
              <td class="number">
                <button
                  type="button"
                  class="quiet-button"
                  aria-label={words.removeCurve(path)}
                  onClick={() => onRemove(path)}
                >
                  ×
                </button>
              </td>
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}

import {useEffect, useRef} from 'preact/hooks';
import {shownScale} from '../model/scale';
import {sensesPlace, sensesTurn, type Device, type Scale} from '../model/state';
import type {ChartSource} from '../drawing/strip_chart';
import {eachFrame} from '../store/frames';
import {kColumn, kSlots} from '../store/motion';
import {Card} from '../parts/parts';
import {Help} from '../parts/popup';
import {fixed} from '../parts/text';
import {texts} from '../texts/texts';

interface Row {
  /** In every language the same. */
  readonly id: string;
  readonly name: string;
  readonly unit: string;
  readonly column: number;
  readonly factor: number;
  readonly digits: number;
}

const kPaintMs = 100;

function rowsOf(device: Device | null): Row[] {
  const rows: Row[] = [];
  const words = texts.value.readings;
  if (sensesPlace(device)) {
    ['x', 'y', 'z'].forEach((name, i) =>
      rows.push({
        id: name,
        name,
        unit: 'mm',
        column: kColumn.position + i,
        factor: 1000,
        digits: 1,
      }),
    );
  }
  if (device === null || device.forceMaxNewton > 0) {
    rows.push({
      id: 'force',
      name: words.force,
      unit: 'N',
      column: kColumn.forceLength,
      factor: 1,
      digits: 2,
    });
  }
  if (sensesTurn(device)) {
    const shown = shownScale({unit: '°', low: -180, high: 180});
    ['right', 'up'].forEach((id, i) =>
      rows.push({
        id,
        name: i === 0 ? words.right : words.up,
        column: kColumn.direction + i,
        ...shown,
      }),
    );
  }
  const addScales = (scales: readonly Scale[], first: number) =>
    scales
      .slice(0, kSlots)
      .forEach((scale, i) =>
        rows.push({id: scale.name, name: scale.name, column: first + i, ...shownScale(scale)}),
      );
  addScales(device?.joints ?? [], kColumn.joint);
  addScales(device?.analogs ?? [], kColumn.analog);
  return rows;
}

interface Props {
  name: string;
  device: Device | null;
  source: () => ChartSource | null;
}

/** The newest numbers, large. */
export function Readings({name, device, source}: Props) {
  const list = useRef<HTMLDListElement>(null);
  const rows = rowsOf(device);
  const latest = useRef({rows, source});
  latest.current = {rows, source};
  useEffect(() => {
    let lastMs = 0;
    return eachFrame((nowMs) => {
      if (nowMs - lastMs < kPaintMs) return;
      lastMs = nowMs;
      const shown = latest.current.source();
      list.current?.querySelectorAll('b').forEach((cell, i) => {
        const row = latest.current.rows[i];
        const value =
          shown === null || row === undefined || !shown.isFresh
            ? NaN
            : shown.series.valueAt(shown.series.size - 1, row.column) * row.factor;
        cell.textContent = fixed(value, row?.digits ?? 0);
      });
    });
  }, [name]);
  if (rows.length === 0) return null;
  const words = texts.value.readings;
  const title = (
    <>
      {words.title} <Help of={words.title}>{words.help}</Help>
    </>
  );
  return (
    <Card title={title} class="now">
      <dl ref={list} class="readings" data-testid="readings">
        {rows.map((row) => (
          <div key={row.id} data-reading={row.id}>
            <dt>{row.name}</dt>
            <dd>
              <b>–</b> <span class="unit">{row.unit}</span>
            </dd>
          </div>
        ))}
      </dl>
    </Card>
  );
}

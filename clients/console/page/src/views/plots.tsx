import {useEffect, useRef} from 'preact/hooks';
import {DirectionView, kTrailS, type Direction} from '../drawing/direction_view';
import {PlotChart} from '../drawing/plot';
import type {Plot} from '../model/layout';
import {Choice, Empty, Notice} from '../parts/parts';
import {Help} from '../parts/popup';
import {bytes, thousands} from '../parts/text';
import {useApp, type App} from '../store/app';
import {eachFrame} from '../store/frames';
import {titleOf} from '../store/plots';
import {writeRoute} from '../store/route';
import {texts} from '../texts/texts';
import {FieldSearch} from './field_search';
import {LayoutMenu} from './layout_menu';
import {PlotMenu} from './plot_menu';

const kWindows = [10, 30, 60, 300, 1200, 3600, 14400] as const;
const kZoom = 0.5;
const kPan = 0.5;

function directionFields(plot: Plot): string[] {
  return plot.fields.flatMap((name) => [
    `${name}/sampled.direction_deg.right`,
    `${name}/sampled.direction_deg.up`,
  ]);
}

/** Any fields of any devices over one axis of time. */
export function PlotsView() {
  const app = useApp();
  const {plots} = app;
  const {subject} = app.route.value;
  const words = texts.value.plots;
  const search = useRef<HTMLInputElement>(null);
  const layout = plots.layout.value;
  const opened = useRef<string | null>(null);
  // A layout of devices waits for them.
  const hasDevices = app.devices.value.length > 0;
  useEffect(() => {
    if (opened.current === `${subject} ${hasDevices}`) return;
    opened.current = `${subject} ${hasDevices}`;
    plots.open(subject);
  }, [subject, hasDevices]);

  // The address follows what is shown, so that a reload and a copy of it have the same.
  const address = plots.subject;
  useEffect(() => {
    if (layout.plots.length === 0 || !window.location.hash.startsWith('#/plots')) return;
    window.history.replaceState(null, '', writeRoute('plots', address));
  }, [address]);

  const paths = layout.plots.flatMap((plot) =>
    plot.kind === 'direction' ? directionFields(plot) : plot.fields,
  );
  const joined = paths.join('\n');
  // Before the plots, which look for their fields.
  if (plots.data.shown !== joined) plots.data.show(joined === '' ? [] : joined.split('\n'));
  useEffect(
    () =>
      eachFrame(() => {
        const {fromS, toS} = plots.view.span;
        plots.data.refresh(fromS, toS, plots.view.fixed.peek() === null);
      }),
    [],
  );
  useEffect(() => () => plots.data.show([]), []);

  return (
    <div class="plots live-zone">
      <Toolbar />
      <FieldSearch inputRef={search} />
      {plots.isLinkBroken.value && (
        <Notice tone="warn" role="status">
          {words.brokenLink}
        </Notice>
      )}
      <UndoNotice />
      {plots.data.problem.value !== '' && (
        <Notice tone="warn" role="status">
          {words.noPast(plots.data.problem.value)}
        </Notice>
      )}
      {layout.plots.length === 0 ? (
        <Empty>{words.empty}</Empty>
      ) : (
        <div class="plot-grid">
          {layout.plots.map((plot, i) => (
            <PlotCard
              key={`${i} ${plot.kind}`}
              plot={plot}
              at={i}
              count={layout.plots.length}
              onAdd={() => {
                plots.target.value = i;
                search.current?.focus();
              }}
            />
          ))}
        </div>
      )}
      <Memory />
    </div>
  );
}

function Toolbar() {
  const app = useApp();
  const {view, layout} = app.plots;
  const words = texts.value.plots;
  const isPaused = view.fixed.value !== null;
  return (
    <div class="plots-bar">
      <LayoutMenu />
      <Choice
        label={words.window}
        options={kWindows.map((value) => ({value, label: words.seconds(value)}))}
        value={isPaused ? 0 : layout.value.windowS}
        onChange={(value) => app.plots.setWindow(value)}
      />
      <div class="row" role="group" aria-label={words.range}>
        <button
          type="button"
          class={isPaused ? 'strong' : ''}
          data-testid="plots-pause"
          onClick={() => (isPaused ? view.follow() : view.pause())}
        >
          {isPaused ? `▶ ${words.follow}` : `❚❚ ${words.pause}`}
        </button>
        <button type="button" aria-label={words.earlier} onClick={() => view.move(-kPan)}>
          ←
        </button>
        <button type="button" aria-label={words.later} onClick={() => view.move(kPan)}>
          →
        </button>
        <button type="button" aria-label={words.closer} onClick={() => view.zoom(kZoom)}>
          +
        </button>
        <button type="button" aria-label={words.wider} onClick={() => view.zoom(1 / kZoom)}>
          −
        </button>
        <Help of={words.range}>{words.help}</Help>
      </div>
      {isPaused && (
        <p class="plots-paused" role="status">
          {words.paused}
        </p>
      )}
    </div>
  );
}

interface CardProps {
  plot: Plot;
  at: number;
  count: number;
  onAdd: () => void;
}

function PlotCard({plot, at, count, onAdd}: CardProps) {
  const app = useApp();
  const {plots} = app;
  const words = texts.value.plots;
  const title = titleOf(plot);
  return (
    <section class="card plot" aria-label={title} data-testid={`plot-${at}`}>
      <div class="card-head">
        <h2>{title === '' ? words.untitled : title}</h2>
        <div class="row">
          {plot.kind === 'time' && (
            <button type="button" aria-label={words.addCurveTo(title)} onClick={onAdd}>
              + {words.curve}
            </button>
          )}
          <PlotMenu plot={plot} at={at} count={count} />
        </div>
      </div>
      {plot.kind === 'direction' ? (
        <DirectionView source={() => trailOf(app, plot.fields[0] ?? '')} />
      ) : plot.fields.length === 0 ? (
        <Empty>{words.emptyPlot}</Empty>
      ) : (
        <PlotChart
          plot={plot}
          title={title}
          data={plots.data}
          view={plots.view}
          nowMs={app.nowMs}
          isLive={() => app.isLive.peek()}
          markers={() => app.markers.live}
          onRemove={(path) => plots.removeCurve(at, path)}
        />
      )}
    </section>
  );
}

/** Where the device pointed in the second before the crosshair, or before now. */
function trailOf(app: App, device: string): readonly Direction[] {
  const {data, view} = app.plots;
  const right = data.field(`${device}/sampled.direction_deg.right`)?.ring;
  const up = data.field(`${device}/sampled.direction_deg.up`)?.ring;
  if (right === undefined || up === undefined) return [];
  const endS = view.crosshairS.peek() ?? view.span.toS;
  const trail: Direction[] = [];
  const last = right.rowAt(endS);
  for (let row = right.rowAt(endS - kTrailS); row < last; ++row) {
    // Both come with the same message.
    trail.push([right.valueAt(row), up.valueAt(row)]);
  }
  return trail;
}

function UndoNotice() {
  const {plots} = useApp();
  const undo = plots.undo.value;
  const words = texts.value.plots;
  if (undo === null) return null;
  return (
    <Notice tone="plain" role="status">
      {words[undo.what](undo.name)}
      <button type="button" onClick={() => plots.revert()}>
        {words.undo}
      </button>
      <button type="button" onClick={() => (plots.undo.value = null)}>
        {texts.value.parts.close}
      </button>
    </Notice>
  );
}

function Memory() {
  const app = useApp();
  const words = texts.value.plots;
  const history = app.state.value?.history ?? null;
  if (history === null) return null;
  return (
    <p class="quiet small plots-memory">
      {words.memory(
        thousands(history.fieldCount),
        bytes(history.byteCount),
        bytes(history.byteMax),
      )}
      {history.droppedCount > 0 && ` ${words.dropped(thousands(history.droppedCount))}`}
      {!app.plots.data.hasPast && ` ${words.needsToken}`}
    </p>
  );
}

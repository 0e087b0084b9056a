import {signal} from '@preact/signals';
import {useState} from 'preact/hooks';
import {kLatencyColumn, useApp} from '../store/app';
import {plotsOfDevice} from '../store/plots';
import {writeRoute} from '../store/route';
import {texts} from '../texts/texts';
import {byUnit, type PlacedScale} from '../model/scale';
import {finder} from '../model/words';
import {
  freshness,
  kStaleMs,
  sensesPlace,
  sensesTurn,
  type Device,
  type Scale,
} from '../model/state';
import {kColumn, kSlots, type Track} from '../store/motion';
import {DirectionView, kTrailS, type Direction} from '../drawing/direction_view';
import {Histogram} from '../drawing/histogram';
import {SpaceView} from '../drawing/space_view';
import {StripChart, type ChartSource, type Curve} from '../drawing/strip_chart';
import {Combobox, type Option} from '../parts/combobox';
import {Card, Choice, Empty} from '../parts/parts';
import {Help} from '../parts/popup';
import {Cameras} from './cameras';
import {CommandCard} from './commands';
import {conditionText} from './device_status';
import {Readings} from './readings';

const kWindows = [
  {value: 10, label: '10 s'},
  {value: 30, label: '30 s'},
  {value: 60, label: '1 min'},
  {value: 300, label: '5 min'},
];
const kOfferedMax = 60;
const kGapS = 0.5;
/** console/latency comes once a second. */
const kLatencyGapS = 3.5;
const windowS = signal(30);

const kPosition: readonly Curve[] = ['x', 'y', 'z'].map((label, i) => ({
  column: kColumn.position + i,
  label,
  paint: label,
}));
const kForce: readonly Curve[] = [
  ...['x', 'y', 'z'].map((label, i) => ({column: kColumn.force + i, label, paint: label})),
  {column: kColumn.forceLength, label: 'total', paint: 'force'},
];
const kDirection: readonly Curve[] = ['right', 'up'].map((label, i) => ({
  column: kColumn.direction + i,
  label,
  paint: i === 0 ? 'x' : 'y',
}));
const kLatency: readonly Curve[] = [
  {column: kLatencyColumn.p50, label: 'p50', paint: 'z'},
  {column: kLatencyColumn.p99, label: 'p99', paint: 'force'},
  {column: kLatencyColumn.max, label: 'max', paint: 'x'},
];
const kPaints = ['z', 'force', 'y', 'x', 'proxy', 'replay', 'quiet', 'text'];

/** One device: motion and force in 3-D and over time, its latency, and its commands. */
export function LiveView() {
  const app = useApp();
  const isReplay = app.showsReplay.value;
  const replayNames = isReplay ? app.shown.names() : [];
  // A recording may have devices that are not there now. Reading the state keeps this up to date.
  const names = [...new Set([...app.devices.value.map((one) => one.name), ...replayNames])];
  const {subject} = app.route.value;
  const preferred = app.devices.value.find((one) => one.className === 'haptic')?.name ?? names[0];
  const name = subject !== '' ? subject : preferred;
  if (name === undefined) return <Empty>{texts.value.live.none}</Empty>;
  const known = names.includes(name) ? names : [...names, name];
  return (
    <div class="live">
      <DevicePicker names={known} chosen={name} />
      <OneDevice key={name} name={name} device={app.device(name)} />
    </div>
  );
}

function DevicePicker({names, chosen}: {names: readonly string[]; chosen: string}) {
  const app = useApp();
  const words = texts.value.live;
  const [query, setQuery] = useState('');
  const [isOpen, setOpen] = useState(false);
  const found = names.filter(finder(query));
  const options = found.slice(0, kOfferedMax).map((name): Option => {
    const device = app.device(name);
    return {
      key: name,
      label: name === chosen ? <b>{name}</b> : name,
      aside: device === null ? '' : `${device.className} · ${conditionText(device)}`,
    };
  });
  return (
    <div class="picker">
      <Combobox
        label={words.device}
        placeholder={words.search}
        value={chosen}
        query={query}
        onQuery={setQuery}
        options={options}
        onChoose={(index) => {
          const name = found[index];
          if (name !== undefined) window.location.hash = writeRoute('live', name);
          setQuery('');
        }}
        isOpen={isOpen}
        onOpen={setOpen}
        note={words.found(options.length, names.length)}
      />
      <a class="button" href={writeRoute('plots', plotsOfDevice(chosen))}>
        {texts.value.plots.openInPlots}
      </a>
      <Choice
        label={texts.value.plots.window}
        options={kWindows}
        value={windowS.value}
        onChange={(value) => (windowS.value = value)}
      />
    </div>
  );
}

function OneDevice({name, device}: {name: string; device: Device | null}) {
  const app = useApp();
  const isReplay = app.showsReplay.value;
  const isLive = app.isLive.value && device !== null && freshness(device) !== 'lost';
  const hasMotion = sensesPlace(device);
  const source = () => sourceOf(app.shown.track(name), app.nowMs(), isReplay, app.isLive.value);
  return (
    <div class={`live-grid ${isLive || isReplay ? '' : 'is-dead'}`}>
      <div class="live-main">
        {!hasMotion && sensesTurn(device) && <DirectionView source={() => trailOf(source())} />}
        {hasMotion && (
          <SpaceView
            name={name}
            device={device}
            motion={app.shown}
            nowMs={app.nowMs}
            isLive={isLive}
            isReplay={isReplay}
          />
        )}
        <Charts name={name} device={device} hasMotion={hasMotion} source={source} />
      </div>
      <div class="live-side">
        {isReplay ? <ReplayCard /> : <CommandCard name={name} device={device} />}
        <Cameras />
        <Readings name={name} device={device} source={source} />
        {!isReplay && (
          <Card
            title={texts.value.live.latency}
            class="live-zone"
            aside={<Help of={texts.value.live.latency}>{texts.value.live.latencyHelp}</Help>}
          >
            <Histogram latency={app.latency.value} name={name} />
          </Card>
        )}
      </div>
    </div>
  );
}

function sourceOf(
  track: Track | null,
  nowMs: number,
  isReplay: boolean,
  isLinked: boolean,
): ChartSource | null {
  if (track === null) return null;
  const lastS = track.series.lastS;
  if (lastS === null) return null;
  const {series, offsetS} = track;
  if (isReplay) return {series, offsetS, endS: lastS, isFresh: true};
  // A lost connection stops the charts where they were.
  const endS = isLinked ? (track.endS(nowMs) ?? lastS) : lastS;
  return {series, offsetS, endS, isFresh: isLinked && nowMs - track.sampleMs <= kStaleMs};
}

function trailOf(source: ChartSource | null): readonly Direction[] {
  if (source === null || !source.isFresh) return [];
  const {series} = source;
  const trail: Direction[] = [];
  for (let row = series.rowAt((series.lastS ?? 0) - kTrailS); row < series.size; ++row) {
    trail.push([
      series.valueAt(row, kColumn.direction),
      series.valueAt(row, kColumn.direction + 1),
    ]);
  }
  return trail;
}

/** A hundredth of the widest range, in the shown unit: noise does not fill the chart. */
function spanMinOf(members: readonly PlacedScale[], factor: number): number {
  const ranges = members.map(({scale}) => Math.abs(scale.high - scale.low)).filter(Number.isFinite);
  return Math.max(0, ...ranges) * factor * 0.01 || 0.1;
}

interface ChartsProps {
  name: string;
  device: Device | null;
  hasMotion: boolean;
  source: () => ChartSource | null;
}

function Charts({name, device, hasMotion, source}: ChartsProps) {
  const app = useApp();
  const markers = () => app.shownMarkers;
  const common = {windowS: windowS.value, gapS: kGapS, source, markers};
  const latency = (): ChartSource | null => {
    const series = app.latencySeries.get(name);
    const lastS = series?.lastS ?? null;
    if (series === undefined || lastS === null) return null;
    const quietS = (app.nowMs() - app.latencyMs) / 1000;
    return {series, endS: lastS + (app.isLive.peek() ? quietS : 0), isFresh: quietS < kLatencyGapS};
  };
  // One chart for each unit: on a common axis the greater values would flatten the others.
  const chartsOf = (title: string, scales: readonly Scale[], first: number) =>
    byUnit(scales.slice(0, kSlots)).map(({shown, members}) => (
      <StripChart
        {...common}
        key={`${title} ${shown.unit}`}
        name={members.map(({scale}) => scale.name).join(', ')}
        title={members.map(({scale}) => scale.name).join(', ')}
        scale={shown}
        spanMin={spanMinOf(members, shown.factor)}
        curves={members.map(({scale, index}) => ({
          column: first + index,
          label: scale.name,
          paint: kPaints[index] ?? 'text',
        }))}
      />
    ));
  return (
    <section class="card charts" aria-label={texts.value.live.charts}>
      {hasMotion && (
        <StripChart
          {...common}
          name="position"
          title={texts.value.live.position}
          scale={{unit: 'mm', factor: 1000, digits: 1}}
          spanMin={10}
          curves={kPosition}
        />
      )}
      {(device === null || device.forceMaxNewton > 0) && (
        <StripChart
          {...common}
          name="force"
          title={texts.value.live.force}
          scale={{unit: 'N', factor: 1, digits: 2}}
          spanMin={1}
          curves={kForce}
        />
      )}
      {sensesTurn(device) && (
        <StripChart
          {...common}
          name="direction"
          title={texts.value.live.direction}
          scale={{unit: '°', factor: 1, digits: 1}}
          spanMin={5}
          curves={kDirection}
        />
      )}
      {chartsOf('Joints', device?.joints ?? [], kColumn.joint)}
      {chartsOf('Inputs', device?.analogs ?? [], kColumn.analog)}
      {!app.showsReplay.value && (
        <StripChart
          {...common}
          name="latency"
          title={texts.value.live.latencyShort}
          scale={{unit: 'µs', factor: 1, digits: 0}}
          spanMin={10}
          curves={kLatency}
          isLogarithmic
          gapS={kLatencyGapS}
          source={latency}
        />
      )}
    </section>
  );
}

function ReplayCard() {
  const app = useApp();
  const replay = app.state.value?.replay ?? null;
  return (
    <Card title={texts.value.live.replayTitle} class="replay-card">
      <p>{texts.value.live.replay(replay?.file ?? '')}</p>
      <button type="button" onClick={() => (app.showsReplay.value = false)}>
        {texts.value.live.showLive}
      </button>
    </Card>
  );
}

import {computed, effect, signal, type ReadonlySignal, type Signal} from '@preact/signals';
import {createContext} from 'preact';
import {useContext} from 'preact/hooks';
import {configNames, Form} from '../forms/form';
import {readLatency, type Latency} from '../model/latency';
import {readState, standing, type ConsoleState, type Device} from '../model/state';
import type {Json} from '../protocol/json';
import {Calibration} from './calibration';
import {Commands} from './commands';
import {Exports, fetchByLink} from './exports';
import {Feeds} from './feeds';
import {Link} from './link';
import {AlarmSound} from './alarm_sound';
import {Incidents} from './incidents';
import {Log} from './log';
import {Markers, type MarkerList} from './markers';
import {Motion} from './motion';
import {Operator} from './operator';
import {Plots} from './plots';
import {Recordings} from './recordings';
import {Series} from './series';
import type {Route} from './route';
import {Stop} from './stop';

/** The columns of a device's latency over time. */
export const kLatencyColumn = {p50: 0, p99: 1, max: 2} as const;
const kLatencyRowMax = 360;
const kLatencyTargetMax = 32;

/** Everything that the views share. */
export class App {
  readonly state: Signal<ConsoleState | null> = signal(null);
  readonly latency: Signal<Latency | null> = signal(null);
  readonly latencySeries = new Map<string, Series>();
  /** When the newest latency came, by the page's clock. */
  latencyMs = 0;
  readonly live = new Motion();
  readonly replayed = new Motion();
  readonly commands: Commands;
  readonly stop: Stop;
  readonly log: Log;
  readonly markers: Markers;
  readonly plots: Plots;
  readonly recordings: Recordings;
  readonly exports: Exports;
  readonly incidents: Incidents;
  readonly sound = new AlarmSound();
  readonly operator: Operator;
  /** The views show the recording that is open, instead of the live system. */
  readonly showsReplay: Signal<boolean> = signal(false);

  readonly isVisible: Signal<boolean> = signal(true);
  /** The console's clock minus the page's, by its newest state. */
  private offsetMs = 0;

  readonly isLive = computed(() => this.link.state.value.phase === 'live');
  readonly mayCommand = computed(() => this.link.info.value?.metadata['rtpm.access'] === 'command');
  readonly devices = computed(() => this.state.value?.devices ?? []);
  readonly stopped = computed(() => this.devices.value.filter((one) => one.isStopped));
  readonly notStopped = computed(() => this.state.value?.notStopped ?? []);
  /** How all devices are together. */
  readonly standing = computed(() => standing(this.devices.value));
  /** Objects with parameters; while the connection is lost, as last known. */
  readonly configurable: ReadonlySignal<readonly string[]>;

  private readonly forms = new Map<string, Form>();
  private readonly calibrations = new Map<string, Calibration>();
  private readonly feeds: Feeds;

  constructor(
    readonly link: Link,
    readonly route: Signal<Route>,
    readonly nowMs: () => number,
  ) {
    this.commands = new Commands(link);
    this.stop = new Stop(link, nowMs);
    this.log = new Log(link);
    this.markers = new Markers(link, () => this.consoleMs(), nowMs);
    this.plots = new Plots(link, this.devices, this.isVisible, nowMs, () => this.consoleMs());
    this.recordings = new Recordings(link);
    this.exports = new Exports(link, this.recordings, fetchByLink);
    this.incidents = new Incidents(link);
    this.operator = new Operator(link);
    const names = computed(() => this.devices.value.map((one) => one.name));
    const joined = computed(() => names.value.join('\n'));
    const stableNames = computed(() => joined.value.split('\n').filter((name) => name !== ''));
    const subject = computed(() => this.route.value.subject);
    this.feeds = new Feeds(link, this.live, this.replayed, stableNames, subject, nowMs);
    this.configurable = this.rememberConfigurable();
    link.subscribe('console/state', ({value}) => this.takeState(readState(value as Json)));
    link.subscribe('console/latency', ({value, timeNs}) =>
      this.takeLatency(readLatency(value as Json), Number(timeNs) / 1e9),
    );
    link.onParameterChange = (changed) => this.refreshForms(changed);
  }

  setVisible(isVisible: boolean): void {
    this.feeds.setVisible(isVisible);
    this.isVisible.value = isVisible;
    if (isVisible) this.link.check();
  }

  /** The console's time, in milliseconds since 1970. */
  consoleMs(): number {
    return this.nowMs() + this.offsetMs;
  }

  device(name: string): Device | null {
    return this.devices.value.find((one) => one.name === name) ?? null;
  }

  /** The motion that the views show. */
  get shown(): Motion {
    return this.showsReplay.value ? this.replayed : this.live;
  }

  /** The markers that belong to it. */
  get shownMarkers(): MarkerList {
    return this.showsReplay.value ? this.markers.replayed : this.markers.live;
  }

  /** The form of an object's parameters: always the same one, so that drafts stay. */
  form(name: string): Form {
    const known = this.forms.get(name);
    if (known !== undefined) return known;
    const form = new Form(name, this.callConfig(name));
    this.forms.set(name, form);
    return form;
  }

  calibration(name: string): Calibration {
    const known = this.calibrations.get(name);
    if (known !== undefined) return known;
    const changed = () => void this.form(name).refresh();
    const calibration = new Calibration(this.callConfig(name), changed);
    this.calibrations.set(name, calibration);
    return calibration;
  }

  private callConfig(name: string): (method: string, request: Json) => Promise<Json> {
    return (method, request) => this.link.call(`${name}/config/${method}`, request);
  }

  private rememberConfigurable(): ReadonlySignal<readonly string[]> {
    const names = signal<readonly string[]>([]);
    effect(() => {
      if (this.link.services.value.size > 0) names.value = configNames(this.link.services.value);
    });
    return names;
  }

  private takeState(state: ConsoleState): void {
    this.offsetMs = state.timeNs / 1e6 - this.nowMs();
    const before = this.state.peek()?.replay?.file ?? null;
    const after = state.replay?.file ?? null;
    if (before !== after) {
      this.replayed.clear();
      // It ends for all pages; only the page that opens it shows it by itself.
      if (after === null) this.showsReplay.value = false;
    }
    this.state.value = state;
    this.sound.take(state.incidents.unseenAlarm);
  }

  private takeLatency(latency: Latency, timeS: number): void {
    this.latency.value = latency;
    this.latencyMs = this.nowMs();
    for (const target of latency.targets) {
      let series = this.latencySeries.get(target.name);
      if (series === undefined) {
        if (this.latencySeries.size >= kLatencyTargetMax) continue;
        series = new Series(kLatencyRowMax, 3);
        this.latencySeries.set(target.name, series);
      }
      series.push(timeS, [target.p50Us ?? NaN, target.p99Us ?? NaN, target.maxUs ?? NaN]);
    }
  }

  private refreshForms(changed: readonly string[]): void {
    for (const [name, form] of this.forms) {
      if (changed.some((one) => one.startsWith(`${name}.`))) void form.refresh();
    }
  }
}

export const AppContext = createContext<App | null>(null);

export function useApp(): App {
  const app = useContext(AppContext);
  if (app === null) throw new Error('a view stands outside of the app');
  return app;
}

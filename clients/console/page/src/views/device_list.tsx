import {signal} from '@preact/signals';
import {Fragment, type JSX} from 'preact';
import {useEffect, useRef} from 'preact/hooks';
import {useApp} from '../store/app';
import {writeRoute} from '../store/route';
import {folderOf, groupsOf, type Group} from '../model/groups';
import {condition, severity, type Device} from '../model/state';
import {Badge, Card, Confirm, Empty} from '../parts/parts';
import {Help} from '../parts/popup';
import {duration, fixed, percent, rate} from '../parts/text';
import {texts} from '../texts/texts';
import {Age, LeaseText, Lifecycle, otherText, worstText} from './device_status';

/** Up to this number, devices have a card each; more have a row each. */
const kCardMax = 12;
/** A device that is slower than this share of its rate says so in its row. */
const kFullRate = 0.95;

/** Stays while another view shows. */
const search = signal('');
const closedFolders = signal<ReadonlySet<string>>(new Set());

/** All devices, the worst first: as cards while they are few, else as rows in groups by folder. */
export function DeviceList() {
  const app = useApp();
  const words = texts.value.devices;
  const devices = app.devices.value;
  if (devices.length === 0) {
    return (
      <Card title={words.title}>
        <Empty>{words.none}</Empty>
      </Card>
    );
  }
  if (devices.length <= kCardMax) return <Cards devices={devices} />;
  return <Rows devices={devices} />;
}

function Cards({devices}: {devices: readonly Device[]}) {
  const groups = groupsOf(devices, '', () => '');
  return (
    <Card title={<Title />}>
      {groups.map((group) => (
        <section key={group.folder} aria-label={group.folder}>
          {groups.length > 1 && <h3 class="group-name">{group.folder}</h3>}
          <div class="devices">
            {group.devices.map((one) => (
              <DeviceCard key={one.name} device={one} />
            ))}
          </div>
        </section>
      ))}
    </Card>
  );
}

/** Explains the numbers of a device. */
function Title({isRows = false}: {isRows?: boolean}) {
  const words = texts.value.devices;
  const facts: [string, string][] = [
    [words.samples, words.samplesHelp],
    [words.goodCycles, words.goodCyclesHelp],
    [words.lease, words.leaseHelp],
    [words.force, words.forceHelp],
  ];
  return (
    <>
      {words.title}{' '}
      <Help of={words.title}>
        {isRows ? (
          words.rowHelp
        ) : (
          <dl>
            {facts.map(([name, help]) => (
              <Fragment key={name}>
                <dt>{name}</dt>
                <dd>{help}</dd>
              </Fragment>
            ))}
          </dl>
        )}
      </Help>
    </>
  );
}

function DeviceCard({device}: {device: Device}) {
  const app = useApp();
  const words = texts.value.devices;
  const worst = condition(device);
  const state = !app.isLive.value ? 'stale' : worst === 'good' ? 'live' : worst;
  const facts: [string, preact.ComponentChildren][] = [
    [words.samples, words.ofRate(rate(device.samplesPerSecond), rate(device.rateHz))],
    [words.goodCycles, percent(device.successRate)],
    [words.lease, <LeaseText device={device} />],
    [
      words.force,
      device.forceMaxNewton > 0 ? words.upTo(fixed(device.forceMaxNewton, 1)) : words.noForce,
    ],
  ];
  return (
    <article class={`device device-${state}`} aria-label={device.name} data-testid={device.name}>
      <div class="device-head">
        <div>
          <h3>{device.name}</h3>
          <p class="quiet small">
            {device.model}, {device.serial} · {device.className}
          </p>
        </div>
        <div class="device-state">
          <Lifecycle device={device} />
          <Age device={device} isLive={app.isLive.value} />
        </div>
      </div>
      {device.problem !== '' && <p class="problem">{device.problem}</p>}
      {device.faults.length > 0 && (
        <p class="faults">
          {device.faults.map((one) => (
            <Badge key={one} tone="warn">
              {one}
            </Badge>
          ))}
        </p>
      )}
      <dl class="facts">
        {facts.map(([name, value]) => (
          <div key={name}>
            <dt>{name}</dt>
            <dd>{value}</dd>
          </div>
        ))}
      </dl>
      <div class="row">
        <a class="button" href={writeRoute('live', device.name)}>
          {texts.value.views.live}
        </a>
        {device.hasConfig && (
          <a class="button" href={writeRoute('parameters', device.name)}>
            {texts.value.views.parameters}
          </a>
        )}
        {device.lostForS !== null && <Dismiss name={device.name} />}
      </div>
    </article>
  );
}

function Dismiss({name}: {name: string}) {
  const app = useApp();
  const words = texts.value.devices;
  return (
    <Confirm
      label={words.dismiss}
      disabled={!app.isLive.value || !app.mayCommand.value}
      question={words.dismissQuestion(name)}
      confirm={words.dismissOne(name)}
      onConfirm={() => void app.commands.run('dismiss', name)}
    />
  );
}

/** The condition of a device in a word or two: "live", "lost for 12 s". */
function wordOf(device: Device): string {
  const words = texts.value.devices;
  const worst = condition(device);
  if (worst === 'lost' && device.lostForS !== null) return words.lostFor(duration(device.lostForS));
  return words[worst];
}

function Rows({devices}: {devices: readonly Device[]}) {
  const app = useApp();
  const words = texts.value.devices;
  const field = useRef<HTMLInputElement>(null);
  const list = useRef<HTMLDivElement>(null);
  const groups = groupsOf(devices, search.value, wordOf);
  const foundCount = groups.reduce((sum, one) => sum + one.devices.length, 0);
  useEffect(() => {
    const onKey = (event: KeyboardEvent) => {
      const isTyping =
        event.target instanceof HTMLElement && event.target.matches('input, select, textarea');
      if (event.key !== '/' || isTyping || event.ctrlKey || event.altKey || event.metaKey) return;
      event.preventDefault();
      field.current?.focus();
    };
    window.addEventListener('keydown', onKey);
    return () => window.removeEventListener('keydown', onKey);
  }, []);
  const onSearchKey = (event: JSX.TargetedKeyboardEvent<HTMLInputElement>) => {
    const first = list.current?.querySelector<HTMLAnchorElement>('.device-row');
    if (event.key === 'Escape') search.value = '';
    else if (event.key === 'Enter') first?.click();
    else if (event.key === 'ArrowDown') first?.focus();
    else return;
    event.preventDefault();
  };
  const head = (
    <div class="row device-search">
      <span class="quiet small" role="status">
        {foundCount === devices.length
          ? words.count(devices.length)
          : words.found(foundCount, devices.length)}
      </span>
      <input
        ref={field}
        type="search"
        value={search.value}
        placeholder={words.search}
        aria-label={words.search}
        aria-keyshortcuts="/"
        autocomplete="off"
        spellcheck={false}
        onInput={(event) => (search.value = event.currentTarget.value)}
        onKeyDown={onSearchKey}
      />
    </div>
  );
  return (
    <Card title={<Title isRows />} aside={head} class={app.isLive.value ? '' : 'is-not-live'}>
      <div ref={list} class="device-groups" onKeyDown={moveFocus}>
        {groups.map((group) => (
          <Folder key={group.folder} group={group} />
        ))}
        {groups.length === 0 && <Empty>{words.nothingFound(search.value)}</Empty>}
      </div>
    </Card>
  );
}

/** The arrow keys lead to the row beside, above or below, as it is seen. */
function moveFocus(event: JSX.TargetedKeyboardEvent<HTMLDivElement>): void {
  const steps: Record<string, readonly [number, number]> = {
    ArrowUp: [0, -1],
    ArrowDown: [0, 1],
    ArrowLeft: [-1, 0],
    ArrowRight: [1, 0],
  };
  const step = steps[event.key];
  if (step === undefined || event.ctrlKey || event.altKey || event.metaKey) return;
  if (!(event.target instanceof HTMLElement)) return;
  const {left, top} = event.target.getBoundingClientRect();
  let best: HTMLElement | null = null;
  let bestDistance = Infinity;
  for (const one of event.currentTarget.querySelectorAll<HTMLElement>('.device-row, .folder')) {
    const rect = one.getBoundingClientRect();
    const along = step[0] * (rect.left - left) + step[1] * (rect.top - top);
    const across = Math.abs(step[1] * (rect.left - left)) + Math.abs(step[0] * (rect.top - top));
    if (along < 1 || (step[0] !== 0 && across > 1)) continue;
    // First the next line, then the nearest in it.
    const distance = along * 1e4 + across;
    if (distance < bestDistance) [best, bestDistance] = [one, distance];
  }
  if (best === null) return;
  event.preventDefault();
  best.focus();
}

function Folder({group}: {group: Group}) {
  const {folder, devices, standing} = group;
  const words = texts.value.devices;
  const isClosed = closedFolders.value.has(folder) && search.value === '';
  const toggle = () => {
    const closed = new Set(closedFolders.value);
    if (!closed.delete(folder)) closed.add(folder);
    closedFolders.value = closed;
  };
  const tone = severity(standing.worst);
  return (
    <section class="device-group" aria-label={folder}>
      <h3>
        <button
          type="button"
          class={`folder folder-${tone}`}
          aria-expanded={!isClosed}
          onClick={toggle}
        >
          <span aria-hidden="true" class="folder-mark">
            {isClosed ? '▸' : '▾'}
          </span>
          <span class="folder-name">{folder === '' ? words.noFolder : folder}</span>
          <Badge tone={tone}>{worstText(standing)}</Badge>
          {tone !== 'good' && <span class="quiet small">{otherText(standing)}</span>}
        </button>
      </h3>
      {!isClosed && (
        <ul class="device-rows">
          {devices.map((one) => (
            <DeviceRow
              key={one.name}
              name={one.name}
              kind={one.className}
              state={condition(one)}
              word={wordOf(one)}
              rate={rateText(one)}
              isSlow={one.samplesPerSecond < kFullRate * one.rateHz}
              lease={one.lease.state === 'free' ? '' : one.lease.state}
            />
          ))}
        </ul>
      )}
    </section>
  );
}

/** As the device has it, unless it is slower: so that rows stay as they are while all is well. */
function rateText(device: Device): string {
  if (device.samplesPerSecond >= kFullRate * device.rateHz) return rate(device.rateHz);
  return texts.value.devices.ofRate(rate(device.samplesPerSecond), rate(device.rateHz));
}

interface RowProps {
  name: string;
  kind: string;
  state: ReturnType<typeof condition>;
  word: string;
  rate: string;
  isSlow: boolean;
  lease: string;
}

/** Its properties are plain, so that it is made anew only when one of them changes. */
function DeviceRow({name, kind, state, word, rate: samples, isSlow, lease}: RowProps) {
  const {devices} = texts.value;
  const folder = folderOf(name);
  return (
    <li>
      <a
        class={`device-row device-row-${severity(state)}`}
        href={writeRoute('live', name)}
        data-testid={name}
      >
        <span class="row-name">{folder === '' ? name : name.slice(folder.length + 1)}</span>
        <span class="row-state">{word}</span>
        <span class={`row-rate ${isSlow ? 'is-slow' : ''}`}>{samples}</span>
        <span class="row-kind">
          {kind}
          {lease !== '' && ` · ${lease === 'held by this console' ? devices.ours : devices.held}`}
        </span>
      </a>
    </li>
  );
}

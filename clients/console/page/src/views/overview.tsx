import {useApp} from '../store/app';
import {severity, type ConsoleState} from '../model/state';
import {Empty} from '../parts/parts';
import {Help} from '../parts/popup';
import {duration, rate, thousands} from '../parts/text';
import {texts} from '../texts/texts';
import {Consumers} from './consumers';
import {DeviceList} from './device_list';
import {otherText, worstText} from './device_status';
import {Objects, Servers} from './servers';

/** Hosts, servers, lanes, devices and objects, as they are. */
export function OverviewView() {
  const app = useApp();
  const words = texts.value.overview;
  const state = app.state.value;
  if (state === null) return <Empty>{words.waiting}</Empty>;
  return (
    <div class="overview live-zone">
      <Tiles state={state} />
      <DeviceList />
      <div class="overview-tables">
        <Consumers consumers={state.hub.consumers} />
        <Servers state={state} />
        <Objects />
      </div>
    </div>
  );
}

function Tiles({state}: {state: ConsoleState}) {
  const app = useApp();
  const words = texts.value.overview;
  const {registry, hub, clients} = state;
  const standing = app.standing.value;
  return (
    <div class="tiles">
      <Tile
        name={words.registry}
        help={words.registryHelp}
        isOk={registry.isOk}
        value={registry.isOk ? words.answers : words.silent}
        more={registry.isOk ? registry.url : registry.problem}
      />
      <Tile
        name={words.events}
        help={words.eventsHelp}
        isOk={hub.isOk}
        value={hub.isOk ? rate(hub.eventsPerSecond) : words.silent}
        more={
          hub.isOk
            ? `${hub.name}, ${words.consumers(hub.consumerCount)}${omittedText(state.events)}`
            : hub.problem
        }
      />
      <Tile
        name={words.devices}
        help={words.devicesHelp}
        isOk={severity(standing.worst) === 'good'}
        value={worstText(standing)}
        more={
          state.devices.length === 0
            ? words.noneAtRegistry
            : standing.worst === 'good'
              ? words.allFresh
              : otherText(standing)
        }
      />
      <Tile
        name={words.console}
        help={words.consoleHelp}
        isOk
        value={words.up(duration(state.uptimeS))}
        more={`${words.browsers(clients.count)}, ${
          clients.droppedCount === 0
            ? words.upToDate
            : words.skipped(thousands(clients.droppedCount))
        }`}
      />
    </div>
  );
}

function omittedText(events: ConsoleState['events']): string {
  const words = texts.value.overview;
  const parts = [
    events.omittedCount > 0 &&
      words.omitted(thousands(events.omittedCount), String(events.channelCountMax)),
    events.droppedCount > 0 && words.dropped(thousands(events.droppedCount)),
  ];
  return parts.map((one) => (one === false ? '' : `; ${one}`)).join('');
}

interface TileProps {
  name: string;
  help: string;
  isOk: boolean;
  value: string;
  more: string;
}

function Tile(props: TileProps) {
  return (
    <div class={`tile ${props.isOk ? '' : 'is-bad'}`}>
      <span class="tile-name">
        {props.name} <Help of={props.name}>{props.help}</Help>
      </span>
      <strong>
        {!props.isOk && <span aria-hidden="true">⚠ </span>}
        {props.value}
      </strong>
      <span class="tile-more">{props.more}</span>
    </div>
  );
}

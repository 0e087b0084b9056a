import {useApp} from '../store/app';
import {writeRoute} from '../store/route';
import {condition, severity, type ConsoleState, type Device, type Server} from '../model/state';
import {Badge, Card, Confirm, Empty} from '../parts/parts';
import {duration, fixed, micros, rate, thousands} from '../parts/text';
import {Age, LeaseText, Lifecycle, otherText, worstText} from './device_status';

/** Hosts, servers, lanes, devices and objects, as they are. */
export function OverviewView() {
  const app = useApp();
  const state = app.state.value;
  if (state === null) return <Empty>Waiting for the console to say what there is.</Empty>;
  const {registry, hub} = state;
  return (
    <div class="overview live-zone">
      <div class="tiles">
        <Tile
          name="Registry"
          isOk={registry.isOk}
          value={registry.isOk ? 'answers' : 'silent'}
          more={registry.isOk ? registry.url : registry.problem}
        />
        <Tile
          name="Events"
          isOk={hub.isOk}
          value={hub.isOk ? rate(hub.eventsPerSecond) : 'silent'}
          more={
            hub.isOk
              ? `${hub.name}, ${hub.consumerCount} consumers${omittedText(state.events)}`
              : hub.problem
          }
        />
        <Tile
          name="Devices"
          isOk={severity(app.standing.value.worst) === 'good'}
          value={worstText(app.standing.value)}
          more={
            state.devices.length === 0
              ? 'none at the registry'
              : app.standing.value.worst === 'good'
                ? 'samples within the last second'
                : otherText(app.standing.value)
          }
        />
        <Tile
          name="Console"
          isOk
          value={`up ${duration(state.uptimeS)}`}
          more={
            `${state.clients.count} ${state.clients.count === 1 ? 'browser' : 'browsers'}, ` +
            skippedText(state.clients.droppedCount)
          }
        />
      </div>
      <Card title="Devices">
        {state.devices.length === 0 ? (
          <Empty>No device is at the registry. Start one: rtpm-deviced --serve-events.</Empty>
        ) : (
          <div class="devices">
            {state.devices.map((one) => (
              <DeviceCard key={one.name} device={one} />
            ))}
          </div>
        )}
      </Card>
      <Card title="Servers and lanes">
        {state.servers.length === 0 ? (
          <Empty>No server answers.</Empty>
        ) : (
          <Lanes servers={state.servers} />
        )}
      </Card>
      <Card title="Objects">
        <Objects />
      </Card>
    </div>
  );
}

/** What a slow browser skips is shown by newer values, and recorded all the same. */
function skippedText(count: number): string {
  return count === 0
    ? 'all up to date'
    : `slow browsers skipped ${thousands(count)} updates; nothing recorded is lost`;
}

function omittedText(events: ConsoleState['events']): string {
  const many =
    events.omittedCount > 0
      ? `; too many sources: ${thousands(events.omittedCount)} events beyond ` +
        `${events.channelCountMax} channels not shown`
      : '';
  return events.droppedCount > 0
    ? `${many}; ${thousands(events.droppedCount)} not shown, as the console was too busy`
    : many;
}

function Tile(props: {name: string; isOk: boolean; value: string; more: string}) {
  return (
    <div class={`tile ${props.isOk ? '' : 'is-bad'}`}>
      <span class="tile-name">{props.name}</span>
      <strong>
        {!props.isOk && <span aria-hidden="true">⚠ </span>}
        {props.value}
      </strong>
      <span class="tile-more">{props.more}</span>
    </div>
  );
}

function DeviceCard({device}: {device: Device}) {
  const app = useApp();
  const worst = condition(device);
  const state = !app.isLive.value ? 'stale' : worst === 'good' ? 'live' : worst;
  const facts: [string, preact.ComponentChildren][] = [
    ['Samples', `${rate(device.samplesPerSecond)} of ${rate(device.rateHz)}`],
    ['Good cycles', device.successRate === null ? '–' : `${fixed(100 * device.successRate, 0)} %`],
    ['Lease', <LeaseText device={device} />],
    ['Force', device.forceMaxNewton > 0 ? `up to ${fixed(device.forceMaxNewton, 1)} N` : 'none'],
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
          Live
        </a>
        {device.hasConfig && (
          <a class="button" href={writeRoute('parameters', device.name)}>
            Parameters
          </a>
        )}
        {device.lostForS !== null && (
          <Confirm
            label="Dismiss"
            disabled={!app.isLive.value || !app.mayCommand.value}
            question={`Is ${device.name} off, or not of interest? It shows again when it is back.`}
            confirm={`Dismiss ${device.name}`}
            onConfirm={() => void app.commands.run('dismiss', device.name)}
          />
        )}
      </div>
    </article>
  );
}

function Lanes({servers}: {servers: readonly Server[]}) {
  const hosts = [...new Set(servers.map((one) => one.host))].sort();
  return (
    <div class="scroll" tabIndex={0} role="region" aria-label="Servers and lanes">
      <table>
        <thead>
          <tr>
            <th scope="col">Server</th>
            <th scope="col">Lane</th>
            <th scope="col">Priorities</th>
            <th scope="col">Schedule</th>
            <th scope="col">Wait</th>
            <th scope="col" class="number">
              Calls
            </th>
            <th scope="col" class="number">
              Drops
            </th>
            <th scope="col" class="number">
              Longest cycle
            </th>
            <th scope="col" class="number">
              Queued
            </th>
            <th scope="col" class="number">
              Busy
            </th>
          </tr>
        </thead>
        {hosts.map((host) => (
          <tbody key={host}>
            <tr class="host">
              <th scope="rowgroup" colSpan={10}>
                Host {host}
              </th>
            </tr>
            {servers
              .filter((one) => one.host === host)
              .map((server) => (
                <ServerRows key={`${server.name} ${server.processId}`} server={server} />
              ))}
          </tbody>
        ))}
      </table>
    </div>
  );
}

function ServerRows({server}: {server: Server}) {
  const name = (
    <th scope="row">
      {server.name}{' '}
      <span class="quiet">
        :{server.port}, process {server.processId}
      </span>
      {!server.isAlive && (
        <>
          {' '}
          <Badge tone="bad">lost</Badge>
        </>
      )}
    </th>
  );
  if (server.lanes.length === 0) {
    return (
      <tr class={server.isAlive ? '' : 'is-lost'}>
        {name}
        <td colSpan={9} class="quiet">
          no lanes known
        </td>
      </tr>
    );
  }
  return (
    <>
      {server.lanes.map((lane, i) => (
        <tr key={lane.name} class={server.isAlive ? '' : 'is-lost'}>
          {i === 0 ? name : <td />}
          <td>{lane.name}</td>
          <td>{lane.band.join(' – ')}</td>
          <td>{lane.schedule}</td>
          <td>{lane.wait}</td>
          <td class="number">{rate(lane.callsPerSecond)}</td>
          <td class={`number ${lane.dropsPerSecond > 0 ? 'is-warn' : ''}`}>
            {rate(lane.dropsPerSecond)}
          </td>
          <td class="number">{micros(lane.longestCycleUs)}</td>
          <td class="number">{lane.queued}</td>
          <td class="number">{lane.busy}</td>
        </tr>
      ))}
    </>
  );
}

function Objects() {
  const app = useApp();
  const objects = app.state.value?.objects ?? [];
  if (objects.length === 0) return <Empty>The registry has no names.</Empty>;
  const configurable = new Set(app.configurable.value);
  return (
    <div class="scroll" tabIndex={0} role="region" aria-label="Objects">
      <table>
        <thead>
          <tr>
            <th scope="col">Name</th>
            <th scope="col">Interface</th>
            <th scope="col">Where</th>
          </tr>
        </thead>
        <tbody>
          {objects.map((one) => (
            <tr key={one.name}>
              <th scope="row">
                {configurable.has(one.name) ? (
                  <a href={writeRoute('parameters', one.name)}>{one.name}</a>
                ) : (
                  one.name
                )}
              </th>
              <td>{one.interface}</td>
              <td class="quiet">{one.url}</td>
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}

import {useApp} from '../store/app';
import {writeRoute} from '../store/route';
import {laboratoryOf} from '../model/groups';
import type {ConsoleState, Server} from '../model/state';
import {Badge, Card, Empty} from '../parts/parts';
import {Column} from '../parts/popup';
import {micros, rate} from '../parts/text';
import {texts} from '../texts/texts';

/** The servers that the registry knows, with their lanes; and apart those that it does not. */
export function Servers({state}: {state: ConsoleState}) {
  const words = texts.value.servers;
  const {ours, others} = laboratoryOf(state);
  return (
    <Card title={words.title}>
      {ours.length === 0 ? (
        <Empty>{words.none}</Empty>
      ) : (
        <Lanes servers={ours} name={words.title} />
      )}
      {others.length > 0 && (
        <details class="others">
          <summary>{words.others(others.length)}</summary>
          <Lanes servers={others} name={words.others(others.length)} />
        </details>
      )}
    </Card>
  );
}

function Lanes({servers, name}: {servers: readonly Server[]; name: string}) {
  const words = texts.value.servers;
  const hosts = [...new Set(servers.map((one) => one.host))].sort();
  return (
    <div class="scroll" tabIndex={0} role="region" aria-label={name}>
      <table>
        <thead>
          <tr>
            <Column name={words.server} />
            <Column name={words.lane} help={words.laneHelp} />
            <Column name={words.priorities} help={words.prioritiesHelp} />
            <Column name={words.schedule} help={words.scheduleHelp} />
            <Column name={words.wait} help={words.waitHelp} />
            <Column name={words.calls} help={words.callsHelp} isNumber />
            <Column name={words.drops} help={words.dropsHelp} isNumber />
            <Column name={words.longest} help={words.longestHelp} isNumber />
            <Column name={words.queued} help={words.queuedHelp} isNumber />
            <Column name={words.busy} help={words.busyHelp} isNumber />
          </tr>
        </thead>
        {hosts.map((host) => (
          <tbody key={host}>
            <tr class="host">
              <th scope="rowgroup" colSpan={10}>
                {words.host(host)}
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
  const words = texts.value.servers;
  const name = (
    <th scope="row">
      {server.name} <span class="quiet">{words.process(server.port, server.processId)}</span>{' '}
      {!server.isAlive && <Badge tone="bad">{words.lost}</Badge>}
    </th>
  );
  if (server.lanes.length === 0) {
    return (
      <tr class={server.isAlive ? '' : 'is-lost'}>
        {name}
        <td colSpan={9} class="quiet">
          {words.noLanes}
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

/** All names at the registry. */
export function Objects() {
  const app = useApp();
  const words = texts.value.objects;
  const objects = app.state.value?.objects ?? [];
  const configurable = new Set(app.configurable.value);
  return (
    <Card title={words.title}>
      {objects.length === 0 ? (
        <Empty>{words.none}</Empty>
      ) : (
        <div class="scroll objects" tabIndex={0} role="region" aria-label={words.title}>
          <table>
            <thead>
              <tr>
                <Column name={words.name} />
                <Column name={words.interface} />
                <Column name={words.where} />
              </tr>
            </thead>
            <tbody>
              {objects.map((one) => (
                <ObjectRow
                  key={one.name}
                  name={one.name}
                  type={one.interface}
                  url={one.url}
                  isConfigurable={configurable.has(one.name)}
                />
              ))}
            </tbody>
          </table>
        </div>
      )}
    </Card>
  );
}

interface ObjectProps {
  name: string;
  type: string;
  url: string;
  isConfigurable: boolean;
}

function ObjectRow({name, type, url, isConfigurable}: ObjectProps) {
  return (
    <tr>
      <th scope="row">
        {isConfigurable ? <a href={writeRoute('parameters', name)}>{name}</a> : name}
      </th>
      <td>{type}</td>
      <td class="quiet">{url}</td>
    </tr>
  );
}

import {
  condition,
  kConditions,
  standing,
  type ConsoleState,
  type Consumer,
  type Device,
  type Server,
  type Standing,
} from './state';
import {finder} from './words';

/** The conditions, in the order in which an operator looks for it. */

/** arm2 before arm10. */
const natural = new Intl.Collator('en', {numeric: true});

export interface Group {
  /** "lab" of lab/arm0; empty: the names have none. */
  readonly folder: string;
  /** The worst first. */
  readonly devices: readonly Device[];
  readonly standing: Standing;
}

export function folderOf(name: string): string {
  return name.slice(0, Math.max(0, name.lastIndexOf('/')));
}

function rank(device: Device): number {
  return kConditions.indexOf(condition(device));
}

/** The texts of a device by which it is found. */
function textOf({name, model, serial, className, lifecycle, faults, lease}: Device): string {
  return [name, model, serial, className, lifecycle, lease.state, ...faults].join('\n');
}

/**
 * The devices that a search finds, by folder: the folder with the worst device first.
 * @param wordOf  the condition of a device as it is shown, by which it is found, too
 */
export function groupsOf(
  devices: readonly Device[],
  search: string,
  wordOf: (device: Device) => string,
): readonly Group[] {
  const isFound = finder(search);
  const byFolder = new Map<string, Device[]>();
  for (const device of devices) {
    if (!isFound(`${textOf(device)}\n${wordOf(device)}`)) continue;
    const folder = folderOf(device.name);
    const known = byFolder.get(folder);
    if (known === undefined) byFolder.set(folder, [device]);
    else known.push(device);
  }
  return [...byFolder]
    .map(([folder, members]) => ({
      folder,
      devices: members.sort((a, b) => rank(a) - rank(b) || natural.compare(a.name, b.name)),
      standing: standing(members),
    }))
    .sort(
      (a, b) =>
        kConditions.indexOf(a.standing.worst) - kConditions.indexOf(b.standing.worst) ||
        natural.compare(a.folder, b.folder),
    );
}

/** The slowest first: by what waits for them, then by what they missed. */
export function slowestFirst(consumers: readonly Consumer[]): readonly Consumer[] {
  return [...consumers].sort(
    (a, b) =>
      (b.lagMs ?? 0) - (a.lagMs ?? 0) ||
      b.waitingCount - a.waitingCount ||
      b.droppedCount - a.droppedCount ||
      natural.compare(a.name, b.name),
  );
}

const kPort = /:(\d+)(?=[,/]|$)/g;

/** The servers of this host that the registry knows, and the others. */
export function laboratoryOf(state: Pick<ConsoleState, 'servers' | 'objects' | 'registry'>): {
  readonly ours: readonly Server[];
  readonly others: readonly Server[];
} {
  const urls = [state.registry.url, ...state.objects.map((one) => one.url)];
  const ports = new Set(urls.flatMap((url) => [...url.matchAll(kPort)].map((one) => one[1])));
  const isOurs = (server: Server) => ports.has(String(server.port));
  return {
    ours: state.servers.filter(isOurs),
    others: state.servers.filter((server) => !isOurs(server)),
  };
}

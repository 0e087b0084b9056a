import { lookup } from "node:dns/promises";
import { isIP } from "node:net";
import { CallError } from "../client/errors.js";
import { CallingNode, type CallingOptions, type LinkOptions } from "../client/calling_node.js";
import { registryAddresses, type Url } from "../core/url.js";
import type { KeyPair } from "../sealed/algorithms.js";
import { nodeAlgorithms } from "./algorithms.js";
import { nodeClock, ownClockDomain } from "./clock.js";
import { TcpRoute, UdpRoute } from "./routes.js";

/** The keys by which a node's calls are sealed. */
export interface NodeKeys {
  readonly own: KeyPair;
  /** The key of the server at a numeric host; undefined: its sessions are not sealed. */
  serverKey(host: string, port: number): Uint8Array | undefined;
}

export interface NodeOptions extends CallingOptions {
  /**
   * Registries that share their names, where names are looked up: `host`, `host:port`,
   * `[ipv6]:port` or `rtpm://host:port/rtpm/names`, port 7420 where none is stated. Default: those
   * of the environment variable RTPM_REGISTRY, else the one of this host.
   */
  readonly registries?: readonly string[];
  /** How servers are called; default `udp`. */
  readonly transport?: "udp" | "tcp";
  /** Seals calls to the servers whose key it knows. */
  readonly keys?: NodeKeys;
}

/**
 * A program's end of all its calls: it binds objects of servers, and shares sessions between
 * bindings to one server. Close it, or declare it with `await using`.
 */
export class Node extends CallingNode {
  /** @throws RangeError for a registry of another form */
  constructor(private readonly options: NodeOptions = {}) {
    const stated = options.registries ?? [process.env["RTPM_REGISTRY"] || "127.0.0.1"];
    const registries = {
      addresses: stated.flatMap(registryAddresses),
      remedy: "start rtpm-registryd, or state where one runs in RTPM_REGISTRY or `registries`",
    };
    super({ ...options, registries }, nodeClock, ownClockDomain());
  }

  protected hostsOf(url: Url): Promise<string[]> {
    return numericHosts(url);
  }

  protected linkOptions(host: string, port: number): LinkOptions {
    const { transport = "udp", keys } = this.options;
    const serverKey = keys?.serverKey(host, port);
    const isSealed = serverKey !== undefined;
    const route =
      transport === "udp" ? new UdpRoute(host, port) : new TcpRoute(host, port, isSealed);
    if (keys === undefined || serverKey === undefined) return { route };
    return { route, sealed: { algorithms: nodeAlgorithms, own: keys.own, serverKey } };
  }
}

// In the order of the system (hp-10-2).
async function numericHosts(url: Url): Promise<string[]> {
  const hosts: string[] = [];
  for (const host of url.hosts) {
    if (isIP(host.split("%")[0]!) !== 0) {
      hosts.push(host);
      continue;
    }
    try {
      const found = await lookup(host, { all: true, order: "verbatim" });
      hosts.push(...found.map((one) => one.address));
    } catch (error) {
      if (url.hosts.length > 1) continue;
      const why = error instanceof Error ? error.message : String(error);
      throw new CallError("unreachable", host, why, false);
    }
  }
  return [...new Set(hosts)].slice(0, 16);
}

import { CallingNode, type CallingOptions, type LinkOptions } from "../client/calling_node.js";
import { defaultPort } from "../core/numbers.js";
import { hostInUrl, type Url } from "../core/url.js";
import { pageClock } from "./clock.js";
import { GatewayRoute } from "./gateway_route.js";

export interface NodeOptions extends CallingOptions {
  /** The gateway of rtpm-console; default: of the console that served this page. */
  readonly gateway?: string | URL;
  /** The console's token; default: `token` of this page's address. */
  readonly token?: string;
}

// The gateway knows where the registry is.
const names = "names";

/**
 * A page's end of all its calls, through the gateway of rtpm-console: it binds objects whose servers
 * the console's registry names. Close it, or declare it with `await using`.
 */
export class Node extends CallingNode {
  private readonly gateway: URL;

  constructor(options: NodeOptions = {}) {
    const registries = {
      addresses: [`rtpm://${names}:${defaultPort}/rtpm/names`],
      name: "of the console",
      remedy: "start rtpm-registryd where rtpm-console looks for it, and state the right token",
    };
    super({ ...options, registries }, pageClock, 0n);
    this.gateway = gatewayOf(options);
  }

  protected hostsOf(url: Url): Promise<string[]> {
    return Promise.resolve([...url.hosts]);
  }

  protected linkOptions(host: string, port: number): LinkOptions {
    const to = host === names ? names : `${hostInUrl(host)}:${port}`;
    return { route: new GatewayRoute(this.gateway, to) };
  }
}

function gatewayOf({ gateway, token }: NodeOptions): URL {
  const page = globalThis.location as Location | undefined;
  if (gateway === undefined && page === undefined) {
    throw new TypeError("there is no page whose console has the gateway: state `gateway`");
  }
  const url = new URL(gateway ?? "/gateway", page?.href);
  if (url.protocol === "http:") url.protocol = "ws:";
  if (url.protocol === "https:") url.protocol = "wss:";
  const known = token ?? (page && new URLSearchParams(page.search).get("token"));
  if (known) url.searchParams.set("token", known);
  return url;
}

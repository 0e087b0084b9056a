import { printable, viewOf } from "../core/bytes.js";
import { messageSizeCeiling, millisecond } from "../core/numbers.js";
import { isValidPath, parseUrl, urlText, type Url } from "../core/url.js";
import type { SealedClientConfig } from "../sealed/client.js";
import type { CallOptions } from "../values/caller.js";
import type { Interface } from "../values/method.js";
import type { Binder, Owned } from "./binder.js";
import { Binding, type Place } from "./binding.js";
import { Directory, type BindAt, type Registries } from "./directory.js";
import { CallError } from "./errors.js";
import { ServerLink } from "./server_link.js";
import type { Clock, Route } from "./transport.js";

/** The options of each kind of node. */
export interface CallingOptions {
  /** The deadline of calls that state none; default 1000. */
  readonly deadlineMs?: number;
  /** The priority of calls and objects that state none, 0 to 32767; default 0. */
  readonly priority?: number;
  /** The largest reply or item that is taken, in bytes; default 16 MiB. */
  readonly messageSizeMax?: number;
  /** How many items of a stream are taken at a time, 1 to 32; default 16. */
  readonly streamWindow?: number;
}

/** How one server is reached. */
export interface LinkOptions {
  readonly route: Route;
  readonly sealed?: Omit<SealedClientConfig, "medium" | "handshakeNumber">;
}

function randomNumber(): bigint {
  const bytes = globalThis.crypto.getRandomValues(new Uint8Array(8));
  return viewOf(bytes).getBigUint64(0, true) | 1n;
}

/** A node without its sockets: what those of Node and browsers have in common. */
export abstract class CallingNode implements Binder, AsyncDisposable {
  /** The names of the node's registries. */
  readonly names: Directory;
  private readonly links = new Map<string, ServerLink>();
  private readonly owned = new Set<Owned>();
  private readonly epoch = randomNumber();
  private channelCount = 0n;
  private isClosing = false;
  private isClosed = false;

  /** @internal */
  protected constructor(
    private readonly calling: CallingOptions & { readonly registries: Registries },
    /** @internal */
    readonly clock: Clock,
    /** @internal */
    readonly clockDomain: bigint,
  ) {
    const bindAt: BindAt = (address, description, inner) => this.bind(address, description, inner);
    this.names = new Directory(calling.registries, bindAt, clock);
  }

  /** The hosts of an address, as routes take them, in the order to try them. @internal */
  protected abstract hostsOf(url: Url): Promise<string[]>;
  /** @internal */
  protected abstract linkOptions(host: string, port: number): LinkOptions;

  /**
   * Binds an object by its name, "lab/arm0", one below it, "lab/arm0/config", or its address,
   * "rtpm://host:port/path". A binding by name follows it: where a server does not answer, the name
   * is looked up again.
   * @throws CallError if no server answers, it has no such object, or its interface is another one;
   *   NameError if the name is not bound; RangeError for a text that is neither name nor address
   */
  async bind(address: string, description: Interface, options: CallOptions = {}): Promise<Binding> {
    const end = this.clock.now() + this.deadlineMs(options) * millisecond;
    if (isValidPath(address)) {
      const url = urlOf(await this.names.addressOf(address, options));
      const lookUp = async (): Promise<Place> => {
        const found = urlOf(await this.names.addressOf(address));
        const [host] = await this.hostsOf(found);
        return { link: this.linkTo(host ?? "", found.port), path: found.path };
      };
      return await this.bindUrl(url, description, options, end, lookUp);
    }
    return await this.bindUrl(urlOf(address), description, options, end);
  }

  private async bindUrl(
    url: Url,
    description: Interface,
    options: CallOptions,
    end: number,
    lookUp?: () => Promise<Place>,
  ): Promise<Binding> {
    const hosts = await this.hostsOf(url);
    let failure: unknown;
    // hp-10-2: each address has an equal part of the time that is left.
    for (const [index, host] of hosts.entries()) {
      const leftMs = (end - this.clock.now()) / millisecond;
      const binding = this.bindingTo(host, url, description, lookUp);
      try {
        await binding.open({ ...options, deadlineMs: leftMs / (hosts.length - index) });
        return binding;
      } catch (error) {
        failure = error;
      }
    }
    throw failure ?? new CallError("unreachable", urlText(url), "its name has no address", false);
  }

  /** @internal */
  own(one: Owned): () => void {
    this.owned.add(one);
    if (this.isClosing) queueMicrotask(() => void one.close());
    return () => this.owned.delete(one);
  }

  /**
   * Closes its leases of devices and its consumers of events, unbinds the names that it keeps, and
   * closes all sessions; open calls fail with `closed`. Without it the process does not end.
   */
  async close(): Promise<void> {
    this.isClosing = true;
    await Promise.all([...this.owned].map((one) => one.close()));
    await this.names.close();
    this.isClosed = true;
    for (const link of this.links.values()) link.close();
    this.links.clear();
  }
  [Symbol.asyncDispose](): Promise<void> {
    return this.close();
  }

  private deadlineMs(options: CallOptions): number {
    return options.deadlineMs ?? this.calling.deadlineMs ?? 1000;
  }

  private bindingTo(
    host: string,
    url: Url,
    description: Interface,
    lookUp?: () => Promise<Place>,
  ): Binding {
    return new Binding({
      place: { link: this.linkTo(host, url.port), path: url.path },
      ...(lookUp === undefined ? {} : { lookUp }),
      clock: this.clock,
      description,
      priority: this.calling.priority ?? 0,
      deadlineMs: this.calling.deadlineMs ?? 1000,
      streamWindow: this.calling.streamWindow ?? 16,
    });
  }

  private linkTo(host: string, port: number): ServerLink {
    if (this.isClosed) throw new CallError("unreachable", host, "the node is closed", false);
    const key = `${host} ${port}`;
    const known = this.links.get(key);
    if (known !== undefined) return known;
    const { route, sealed } = this.linkOptions(host, port);
    const handshakeNumber = (): number => Number(randomNumber() & 0xffff_ffffn);
    const link = new ServerLink(route.medium, () => ({
      route,
      clock: this.clock,
      channel: {
        clientEpoch: this.epoch,
        channel: ++this.channelCount,
        clockDomain: this.clockDomain,
        messageSizeMax: this.calling.messageSizeMax ?? messageSizeCeiling,
        handshakeNumber: handshakeNumber(),
      },
      ...(sealed === undefined
        ? {}
        : { sealed: { ...sealed, handshakeNumber: handshakeNumber() } }),
    }));
    this.links.set(key, link);
    return link;
  }
}

function urlOf(address: string): Url {
  const url = parseUrl(address);
  if (url !== undefined) return url;
  throw new RangeError(
    `"${printable(address)}" is no name lab/arm0 or address rtpm://host:port/path`,
  );
}

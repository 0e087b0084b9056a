import {
  BindRequest,
  ListRequest,
  NamesClient,
  NamesInterface,
  OutcomeCode,
  type Entry,
  type OwnerId,
} from "../../idl/names.rtpm.js";
import { millisecond } from "../core/numbers.js";
import type { CallOptions, Caller } from "../values/caller.js";
import type { Interface } from "../values/method.js";
import { CallError, type CallErrorCode } from "./errors.js";
import type { Clock } from "./transport.js";

/** Binds an object at a registry's address. */
export type BindAt = (
  address: string,
  description: Interface,
  options: CallOptions,
) => Promise<Caller>;

/** A refusal of the registry, such as NotFound or AlreadyBound. */
export class NameError extends Error {
  override readonly name = "NameError";

  constructor(
    /** A name of OutcomeCode, "AlreadyBound". */
    readonly outcome: string,
    detail: string,
  ) {
    super(detail);
  }
}

const outcomeNames = new Map<number, string>(
  Object.entries(OutcomeCode).map(([name, code]) => [code, name]),
);

const signsOfNoRegistry = new Set<CallErrorCode>([
  "unreachable",
  "timeout",
  "disconnected",
  "closed",
]);

/** Where names are looked up. */
export interface Registries {
  /** Registries that share their names, each asked when the one before does not answer. */
  readonly addresses: readonly string[];
  /** Stands for their addresses in messages. */
  readonly name?: string;
  /** For messages: how to get one that answers. */
  readonly remedy: string;
}

export interface BindNameOptions {
  /** How long the name stays without a renewal; default 2000. */
  readonly leaseMs?: number;
  /** Takes the name from another server that holds it. */
  readonly allowTakeover?: boolean;
  /** Hears when the name cannot be kept; it is tried again until close(). */
  readonly onTrouble?: (error: unknown) => void;
}

/** The names of one or several registries that share them (docs/names.md). */
export class Directory {
  private readonly clients: (NamesClient | undefined)[];
  private current = 0; // the registry that answered last
  private readonly registrations = new Set<Registration>();
  private isClosed = false;

  /** @internal */
  constructor(
    private readonly registries: Registries,
    private readonly bindAt: BindAt,
    private readonly clock: Clock,
  ) {
    this.clients = registries.addresses.map(() => undefined);
  }

  /** The entry of a name. @throws NameError, NotFound if it is not bound */
  async resolve(name: string, options: CallOptions = {}): Promise<Entry> {
    const reply = await this.ask((names, inner) => names.resolve({ name }, inner), options);
    const { answer, entry } = reply;
    if (answer.outcome !== OutcomeCode.Done || entry === undefined) {
      throw this.errorOf(answer.outcome, name);
    }
    return entry;
  }

  /**
   * The address of a name, or of an object below one: "lab/arm0/config" is served where "lab/arm0"
   * is bound.
   * @throws NameError as resolve()
   */
  async addressOf(name: string, options: CallOptions = {}): Promise<string> {
    for (let bound = name; ; bound = bound.slice(0, bound.lastIndexOf("/"))) {
      try {
        return (await this.resolve(bound, options)).url + name.slice(bound.length);
      } catch (error) {
        const isBelow = error instanceof NameError && error.outcome === "NotADirectory";
        if (!isBelow || !bound.includes("/")) throw error;
      }
    }
  }

  /** The names at and below a directory, or all, in the order of their bytes. */
  async list(directory = "", options: CallOptions = {}): Promise<Entry[]> {
    const entries: Entry[] = [];
    for (;;) {
      const request = ListRequest.of({ directory, after: entries.at(-1)?.name ?? "" });
      const reply = await this.ask((names, inner) => names.list(request, inner), options);
      const { outcome } = reply.answer;
      if (outcome !== OutcomeCode.Done) throw this.errorOf(outcome, directory);
      entries.push(...reply.entries);
      if (reply.isLast || reply.entries.length === 0) return entries;
    }
  }

  /**
   * Binds a name to an object's address, and renews its lease until the registration is closed.
   * Waits for the lease of a former server of the name to end.
   * @throws NameError, AlreadyBound if another server keeps it
   */
  async bindName(
    name: string,
    address: string,
    description: Interface,
    options: BindNameOptions = {},
  ): Promise<Registration> {
    const registration = new Registration(this, this.clock, {
      name,
      url: address,
      interface: description.name,
      leaseMs: options.leaseMs ?? 2000,
      allowTakeover: options.allowTakeover === true,
      onTrouble: options.onTrouble ?? ((error) => console.error("rtpm:", error)),
    });
    await registration.begin();
    this.registrations.add(registration);
    return registration;
  }

  /** Closes all registrations. @internal */
  async close(): Promise<void> {
    await Promise.all([...this.registrations].map((one) => one.close()));
    this.isClosed = true;
  }
  /** @internal */
  forget(registration: Registration): void {
    this.registrations.delete(registration);
  }

  /** Calls the registry that answered last, or else the next ones. @internal */
  async ask<R>(
    call: (names: NamesClient, options: CallOptions) => Promise<R>,
    options: CallOptions,
  ): Promise<R> {
    const end = this.clock.now() + (options.deadlineMs ?? 1000) * millisecond;
    let failure: CallError | undefined;
    const { addresses } = this.registries;
    for (let tried = 0; tried < addresses.length; tried += 1) {
      const index = this.current;
      const left = (end - this.clock.now()) / millisecond;
      const inner = { ...options, deadlineMs: left / (addresses.length - tried) };
      try {
        const names = await this.clientOf(index, inner);
        return await call(names, inner);
      } catch (error) {
        if (!(error instanceof CallError)) throw error;
        failure = error;
        this.current = (index + 1) % addresses.length;
      }
    }
    throw this.isClosed && failure !== undefined ? failure : this.unanswered(failure);
  }

  private unanswered(failure: CallError | undefined): CallError {
    const { addresses, name = addresses.join(" or "), remedy } = this.registries;
    if (failure === undefined) {
      return new CallError("unreachable", "names", `no registry is stated: ${remedy}`, false);
    }
    if (!signsOfNoRegistry.has(failure.code)) return failure;
    const detail = `it does not answer (${failure.message}). Remedy: ${remedy}`;
    return new CallError(failure.code, `the registry ${name}`, detail, failure.wasRun);
  }

  /** @internal */
  errorOf(outcome: number, name: string, holder = ""): NameError {
    const registry = this.registries.name ?? this.registries.addresses[this.current];
    const words: Partial<Record<number, string>> = {
      [OutcomeCode.NotFound]:
        `no server has bound this name at the registry ${registry}; ` +
        "node.names.list() shows the names that are bound",
      [OutcomeCode.BadName]:
        'it is no name: one has 1 to 8 parts with "/" between, each 1 to 64 of ' +
        "A-Z a-z 0-9 . _ -, and at most 200 bytes",
      [OutcomeCode.IsADirectory]:
        "it is a directory of names and leads to no object; " +
        `node.names.list("${name}") shows the names below it`,
      [OutcomeCode.NotADirectory]:
        "a name above it is bound, so that this one cannot be; " +
        "node.bind() finds the objects below a name",
      [OutcomeCode.AlreadyBound]:
        `another server has bound this name to ${holder}; end that server, choose another name, ` +
        "or state allowTakeover",
    };
    const outcomeName = outcomeNames.get(outcome) ?? `outcome ${outcome}`;
    const detail = words[outcome] ?? `the registry ${registry} refuses it: ${outcomeName}`;
    return new NameError(outcomeName, `${name}: ${detail}`);
  }

  private async clientOf(index: number, options: CallOptions): Promise<NamesClient> {
    const known = this.clients[index];
    if (known !== undefined) return known;
    const caller = await this.bindAt(this.registries.addresses[index]!, NamesInterface, options);
    const client = new NamesClient(caller);
    this.clients[index] = client;
    return client;
  }
}

interface Claim {
  readonly name: string;
  readonly url: string;
  readonly interface: string;
  readonly leaseMs: number;
  readonly allowTakeover: boolean;
  readonly onTrouble: (error: unknown) => void;
}

/** A name that is kept bound. Close it, or declare it with `await using`. */
export class Registration implements AsyncDisposable {
  private readonly owner: OwnerId;
  private cancelTimer: (() => void) | undefined;
  private isClosed = false;

  /** @internal */
  constructor(
    private readonly directory: Directory,
    private readonly clock: Clock,
    private readonly claim: Claim,
  ) {
    const [id] = globalThis.crypto.getRandomValues(new BigUint64Array(1));
    this.owner = { id: id! | 1n, epoch: BigInt(Date.now()) };
  }

  get name(): string {
    return this.claim.name;
  }

  /** @internal */
  async begin(): Promise<void> {
    const patience = this.clock.now() + (this.claim.leaseMs + 3000) * millisecond;
    for (;;) {
      try {
        await this.bind();
        break;
      } catch (error) {
        const mayEnd = error instanceof NameError && error.outcome === "AlreadyBound";
        if (!mayEnd || this.clock.now() >= patience) throw error;
        await this.sleep(200);
      }
    }
    this.renewLater();
  }

  /** Stops the renewal and unbinds the name; without a registry its lease ends by itself. */
  async close(): Promise<void> {
    if (this.isClosed) return;
    this.isClosed = true;
    this.directory.forget(this);
    this.cancelTimer?.();
    const { name } = this.claim;
    const request = { name, owner: this.owner, holderRevision: 0n };
    await this.directory
      .ask((names, options) => names.unbind(request, options), {})
      .catch(() => undefined);
  }
  [Symbol.asyncDispose](): Promise<void> {
    return this.close();
  }

  private get leaseNs(): bigint {
    return BigInt(Math.round(this.claim.leaseMs * millisecond));
  }

  private sleep(ms: number): Promise<void> {
    return new Promise((resolve) => {
      this.clock.at(this.clock.now() + ms * millisecond, resolve);
    });
  }

  private async bind(): Promise<void> {
    const { name, url, allowTakeover } = this.claim;
    const request = BindRequest.of({
      name,
      url,
      interface: this.claim.interface,
      owner: this.owner,
      leaseNs: this.leaseNs,
      allowTakeover,
    });
    const { answer, holderUrl } = await this.directory.ask(
      (names, options) =>
        allowTakeover ? names.rebind(request, options) : names.bind(request, options),
      {},
    );
    if (answer.outcome === OutcomeCode.Done) return;
    throw this.directory.errorOf(answer.outcome, name, holderUrl);
  }

  private renewLater(): void {
    if (this.isClosed) return;
    const next = this.clock.now() + (this.claim.leaseMs / 3) * millisecond;
    this.cancelTimer = this.clock.at(next, () => {
      void this.renew()
        .catch((error: unknown) => {
          if (!this.isClosed) this.claim.onTrouble(error);
        })
        .finally(() => this.renewLater());
    });
  }

  private async renew(): Promise<void> {
    const request = { name: this.claim.name, owner: this.owner, leaseNs: this.leaseNs };
    const { outcome } = await this.directory.ask(
      (names, options) => names.renew(request, options),
      {},
    );
    // The registry may have restarted without its names.
    if (outcome !== OutcomeCode.Done && !this.isClosed) await this.bind();
  }
}

import { printable, utf8 } from "../core/bytes.js";
import {
  readBindReply,
  readText,
  writeBindRequest,
  writeDescribeRequest,
  type BindReply,
} from "../core/control.js";
import { findObstacle } from "../core/interface_text.js";
import {
  SessionMethod,
  Status,
  millisecond,
  never,
  priorityHighest,
  second,
  sessionService,
} from "../core/numbers.js";
import { isValidPath } from "../core/url.js";
import type { CallOptions, Caller } from "../values/caller.js";
import { BadValue } from "../values/codec.js";
import type { AnyMethod, Interface, Method } from "../values/method.js";
import type { Connection } from "./connection.js";
import { CallError, errorOfStatus, type CallErrorCode } from "./errors.js";
import type { Call, ServerLink } from "./server_link.js";
import type { Clock } from "./transport.js";

/** Where an object is. */
export interface Place {
  readonly link: ServerLink;
  readonly path: string;
}

export interface BindingConfig {
  readonly place: Place;
  /** Looks the object up again after a failure; of objects that were bound by name. */
  readonly lookUp?: () => Promise<Place>;
  readonly clock: Clock;
  readonly description: Interface;
  /** The priority of a caller that states none, if the object states none either. */
  readonly priority: number;
  /** The deadline of calls that state none, and of the bind. */
  readonly deadlineMs: number;
  /** How many items of a stream are taken at a time. */
  readonly streamWindow: number;
}

const signsOfMoving = new Set<CallErrorCode>([
  "unreachable",
  "timeout",
  "disconnected",
  "closed",
  "restarted",
  "no_such_object",
]);

/** Options that only RTPM's own parts use. */
export interface InnerOptions extends CallOptions {
  readonly traceId?: bigint;
}

/** An object of a server, ready to be called; it survives the server's restart. */
export class Binding implements Caller {
  private bound: { readonly reply: BindReply; readonly epoch: bigint } | undefined;
  private binding: Promise<BindReply> | undefined;

  private place: Place;
  private lookedUp = -Infinity;

  constructor(private readonly config: BindingConfig) {
    this.place = config.place;
  }

  /** The object's path at its server. */
  get path(): string {
    return this.place.path;
  }
  /** The priority that the object declares, if it declares one (hp-6.1-3). */
  get declaredPriority(): number | undefined {
    const reply = this.bound?.reply;
    return reply?.isServerDeclared === true ? reply.priority : undefined;
  }

  /**
   * Opens a session and binds the object, so that the first call has nothing else to do.
   * @throws CallError also if the object has another interface
   */
  async open(options?: CallOptions): Promise<void> {
    const priority = options?.priority ?? this.config.description.priority ?? this.config.priority;
    const deadline = this.deadlineOf(options?.deadlineMs);
    const { link, path } = this.place;
    const connection = await link.connectionFor(priority, deadline, path);
    await this.bind(connection, deadline);
    const declared = this.declaredPriority;
    // hp-6.1-3: calls go by the session of that priority.
    if (declared !== undefined) await link.connectionFor(declared, deadline, path);
  }

  async call<Q, R>(method: Method<Q, R>, request: Q, options?: CallOptions): Promise<R> {
    const payload = method.request.encode(request);
    const end = this.deadlineOf(options?.deadlineMs ?? method.deadlineMs);
    let reply: Uint8Array;
    for (;;) {
      const deadlineMs = (end - this.config.clock.now()) / millisecond;
      try {
        reply = await this.invoke(method, payload, { ...options, deadlineMs });
        break;
      } catch (error) {
        const hasMoved = await this.follow(error, options);
        const mayRepeat = error instanceof CallError && error.wasRun === false;
        const hasTime = this.config.clock.now() < end;
        if (!hasMoved || !hasTime || !(mayRepeat || method.isIdempotent === true)) throw error;
      }
    }
    return this.decodeReply(method, reply);
  }

  // `rtpm_max_size` of the schema; a reply beyond it is no reply of this interface.
  private checkRequest(method: AnyMethod, payload: Uint8Array): void {
    const { maxSize } = method;
    if (maxSize === undefined || payload.length <= maxSize) return;
    const detail = `too_large: the request has ${payload.length} bytes, ${maxSize} are allowed`;
    throw new CallError("too_large", this.targetOf(method), detail, false);
  }
  private decodeReply<Q, R>(method: Method<Q, R>, reply: Uint8Array): R {
    try {
      const { maxSize } = method;
      if (maxSize !== undefined && reply.length > maxSize) {
        throw new BadValue(`${reply.length} bytes, ${maxSize} are allowed`);
      }
      return method.reply.decode(reply);
    } catch (error) {
      if (!(error instanceof BadValue)) throw error;
      throw new CallError("bad_reply", this.targetOf(method), error.message, true);
    }
  }

  /** Calls with bytes, and gives bytes. @internal */
  async invoke(
    method: AnyMethod,
    payload: Uint8Array,
    options?: InnerOptions,
  ): Promise<Uint8Array> {
    const target = this.targetOf(method);
    const call = this.newCall(method, payload, options);
    const { status, payload: reply } = await this.place.link.call(call);
    if (status !== Status.ok) throw errorOfStatus(status, reply, target);
    return reply;
  }

  /**
   * Sends a oneway: at once if the session is there, else once it is.
   * @throws CallError if the session is there and the request is larger than a frame
   */
  send<Q, R>(oneway: Method<Q, R>, request: Q, options?: CallOptions): void {
    const payload = oneway.request.encode(request);
    const call = this.newCall(oneway, payload, options);
    const send = (connection: Connection, service: number): void => {
      const parameters = { ...call.parameters, service, priority: call.priority };
      if (connection.send(parameters, payload) === "too_large") {
        throw new CallError("too_large", call.target, "a oneway has to fit one frame", false);
      }
    };
    const ready = this.place.link.readyConnection(call.priority);
    if (ready !== undefined && this.bound !== undefined && this.bound.epoch === ready.epoch) {
      send(ready, this.bound.reply.service);
      return;
    }
    // Nobody waits for a oneway: one that cannot be sent is lost, as one on the way may be.
    void this.place.link
      .connectionFor(call.priority, call.parameters.deadline, call.target)
      .then(async (connection) => send(connection, await call.service(connection)))
      .catch(() => undefined);
  }

  async *stream<Q, R>(method: Method<Q, R>, request: Q, options?: CallOptions): AsyncGenerator<R> {
    for (;;) {
      let hasItems = false;
      try {
        for await (const item of this.streamHere(method, request, options)) {
          hasItems = true;
          yield item;
        }
        return;
      } catch (error) {
        const hasMoved = await this.follow(error, options);
        const mayRepeat = error instanceof CallError && error.wasRun === false;
        if (!hasMoved || hasItems || !(mayRepeat || method.isIdempotent === true)) throw error;
      }
    }
  }

  // Where the object was last.
  private async *streamHere<Q, R>(
    method: Method<Q, R>,
    request: Q,
    options?: CallOptions,
  ): AsyncGenerator<R> {
    const { link } = this.place;
    const target = this.targetOf(method);
    const call = this.newCall(method, method.request.encode(request), options, true);
    for (;;) {
      const opened = Math.min(call.parameters.deadline, this.deadlineOf(undefined));
      const connection = await link.connectionFor(call.priority, opened, target);
      const service = await call.service(connection);
      const parameters = { ...call.parameters, service, priority: call.priority };
      const items = connection.stream(parameters, call.payload, target, call.signal);
      let hasItems = false;
      try {
        for (;;) {
          const { done, value } = await items.next();
          if (done !== true) {
            hasItems = true;
            yield this.decodeReply(method, value);
            continue;
          }
          if (value.kind !== "reply") {
            await link.judge(value, hasItems ? { ...call, isIdempotent: false } : call);
            break; // begins again
          }
          if (value.status !== Status.ok) throw errorOfStatus(value.status, value.payload, target);
          return;
        }
      } finally {
        await items.return({ kind: "closed" });
      }
      if (hasItems) {
        throw new CallError("restarted", target, "the stream's session was lost behind items");
      }
    }
  }

  /** Asks the server for a sign of life; resolves with the round trip in ms. */
  async ping(options?: CallOptions): Promise<number> {
    const { clock } = this.config;
    const { link } = this.place;
    const begun = clock.now();
    const target = `${this.path}.ping`;
    const deadline = this.deadlineOf(options?.deadlineMs);
    const priority = this.priorityOf(options);
    const service = (): Promise<number> => Promise.resolve(sessionService);
    const { signal } = options ?? {};
    const parameters = { method: SessionMethod.ping, deadline };
    const payload = new Uint8Array(0);
    await link.call({ parameters, priority, payload, isIdempotent: true, target, signal, service });
    return (clock.now() - begun) / millisecond;
  }

  // A server that does not answer may have moved. Returns whether the object is elsewhere now.
  private async follow(error: unknown, options: CallOptions | undefined): Promise<boolean> {
    const { lookUp, clock } = this.config;
    if (lookUp === undefined || !(error instanceof CallError)) return false;
    if (!signsOfMoving.has(error.code) || options?.signal?.aborted === true) return false;
    const now = clock.now();
    if (now - this.lookedUp < second) return false; // at most once a second
    this.lookedUp = now;
    try {
      const place = await lookUp();
      if (place.link === this.place.link && place.path === this.place.path) return false;
      this.place = place;
      this.bound = undefined;
      return true;
    } catch {
      return false; // the call's own failure says more
    }
  }

  // ---- binding ---------------------------------------------------------------------------------

  private targetOf(method: { readonly name: string }): string {
    return `${this.path}.${method.name}`;
  }
  private deadlineOf(deadlineMs: number | undefined): number {
    const { clock } = this.config;
    return clock.now() + Math.ceil((deadlineMs ?? this.config.deadlineMs) * millisecond);
  }
  // hp-6.1-3
  private priorityOf(options: CallOptions | undefined): number {
    const reply = this.bound?.reply;
    if (reply?.isServerDeclared === true) return reply.priority;
    const ofObject = reply === undefined || reply.priority === 0 ? undefined : reply.priority;
    const { description, priority } = this.config;
    return options?.priority ?? ofObject ?? description.priority ?? priority;
  }

  private newCall(
    method: AnyMethod,
    payload: Uint8Array,
    options: InnerOptions | undefined,
    isStream = false,
  ): Call {
    this.checkRequest(method, payload);
    const priority = this.priorityOf(options);
    if (!(priority >= 0 && priority <= priorityHighest)) {
      throw new RangeError(`a priority is 0 to ${priorityHighest}, not ${priority}`);
    }
    const stated = options?.deadlineMs ?? (isStream ? undefined : method.deadlineMs);
    const deadline =
      isStream && stated === undefined ? never : this.deadlineOf(stated ?? this.config.deadlineMs);
    const delivery = method.kind === "receipt" ? "receipt" : "reply";
    const streamOptions = isStream
      ? { streamWindow: this.config.streamWindow, ...this.place.link.streamLease }
      : {};
    return {
      parameters: {
        method: method.id,
        deadline,
        delivery,
        traceId: options?.traceId ?? 0n,
        ...streamOptions,
      },
      priority,
      payload,
      isIdempotent: method.isIdempotent === true,
      target: this.targetOf(method),
      signal: options?.signal,
      service: async (connection) => (await this.bind(connection, deadline)).service,
    };
  }

  // hp-6.1-4: under another epoch the object has another number.
  private async bind(connection: Connection, deadline: number): Promise<BindReply> {
    for (;;) {
      const { bound } = this;
      if (bound !== undefined && bound.epoch === connection.epoch) return bound.reply;
      if (this.binding !== undefined) {
        await this.binding.catch(() => undefined);
        if (this.bound?.epoch === connection.epoch) continue;
      }
      this.binding = this.bindNow(connection, Math.min(deadline, this.deadlineOf(undefined)));
      try {
        return await this.binding;
      } finally {
        this.binding = undefined;
      }
    }
  }

  private async bindNow(connection: Connection, deadline: number): Promise<BindReply> {
    const { description } = this.config;
    const { path } = this.place;
    const request = writeBindRequest({
      fingerprint: description.fingerprint,
      path,
      interfaceName: description.name,
    });
    const answer = await this.ask(connection, SessionMethod.bind, request, deadline);
    if (answer.status === Status.no_such_object) {
      throw new CallError("no_such_object", path, `no such object${similarPaths(answer.payload)}`);
    }
    if (answer.status === Status.wrong_interface) {
      const name = readText(answer.payload, 0)?.text ?? utf8.decode(answer.payload);
      const text = `its interface is ${printable(name)}, not ${description.name}`;
      throw new CallError("interface_mismatch", path, text, false);
    }
    if (answer.status !== Status.ok) throw errorOfStatus(answer.status, answer.payload, path);
    const reply = readBindReply(answer.payload);
    if (reply === undefined) {
      throw new CallError("bad_reply", path, "the server's answer to a bind is malformed", false);
    }
    await this.compare(connection, reply, deadline);
    this.bound = { reply, epoch: answer.epoch };
    return reply;
  }

  private async ask(
    connection: Connection,
    method: number,
    payload: Uint8Array,
    deadline: number,
  ): Promise<{ readonly status: number; readonly payload: Uint8Array; readonly epoch: bigint }> {
    let epoch = 0n;
    const { status, payload: reply } = await this.place.link.call({
      parameters: { method, deadline },
      priority: connection.openPriority,
      payload,
      isIdempotent: true,
      target: this.path,
      service: (used) => {
        epoch = used.epoch ?? 0n;
        return Promise.resolve(sessionService);
      },
    });
    return { status, payload: reply, epoch };
  }

  // hp-6.1-2, hp-6.1-6
  private async compare(connection: Connection, reply: BindReply, deadline: number): Promise<void> {
    const { description } = this.config;
    const { path } = this.place;
    if (reply.fingerprint !== 0n && reply.fingerprint === description.fingerprint) return;
    const theirs = new Map(reply.methods.map((one) => [one.id, one.fingerprint]));
    const isSame = description.methods.every((method) => {
      const other = theirs.get(method.id);
      if (other === undefined) return !reply.isMethodListComplete;
      return method.fingerprint !== undefined && method.fingerprint === other;
    });
    if (isSame) return;
    const mismatch = (why: string): CallError =>
      new CallError("interface_mismatch", path, `${description.name} differs: ${why}`, false);
    const request = writeDescribeRequest(reply.service);
    const answer = await this.ask(connection, SessionMethod.describe, request, deadline);
    if (answer.status !== Status.ok) throw mismatch("its methods have other fingerprints there");
    if (description.text === undefined) throw mismatch("we have no text to compare with");
    const obstacle = findObstacle(description.text, utf8.decode(answer.payload));
    if (obstacle !== undefined) throw mismatch(obstacle);
  }
}

// hp-6.1-1: for a person to read; what is no path is not shown (section 10).
function similarPaths(payload: Uint8Array): string {
  const paths: string[] = [];
  let at = 0;
  while (paths.length < 4) {
    const read = readText(payload, at);
    if (read === undefined) break;
    if (isValidPath(read.text)) paths.push(read.text);
    at = read.end;
  }
  return paths.length === 0 ? "" : `; it has ${paths.join(", ")}`;
}

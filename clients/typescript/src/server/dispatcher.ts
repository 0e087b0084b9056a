import { utf8 } from "../core/bytes.js";
import {
  readBindRequest,
  readDescribeRequest,
  writeBindReply,
  writeTexts,
} from "../core/control.js";
import {
  SessionMethod,
  Status,
  millisecond,
  never,
  sessionService,
  type StatusName,
} from "../core/numbers.js";
import type { Peer } from "../core/peer.js";
import type { Request, ServerEvent, ServerSessions } from "../core/server_sessions.js";
import { isValidPath } from "../core/url.js";
import type { Clock } from "../client/transport.js";
import { BadValue } from "../values/codec.js";
import type { Interface } from "../values/method.js";
import type { AnyOperation, CallContext, Skeleton } from "../values/skeleton.js";

/** Thrown by a servant: the call ends with this status instead of a reply. */
export class Refusal extends Error {
  override readonly name = "Refusal";

  /** @param text  for people; the caller sees it with bad_request and servant_failed (hp-7-1) */
  constructor(
    readonly status: Exclude<StatusName, "ok">,
    text = "",
  ) {
    super(text);
  }
}

export interface DispatcherConfig {
  readonly clock: Clock;
  /** Calls that run at a time, in all. */
  readonly runningMax: number;
  readonly onServantError: (error: unknown, target: string) => void;
}

/** Where a request came from, and how its answers leave. */
export interface RequestSource {
  readonly sessions: ServerSessions;
  /** Sends what the sessions have to send. */
  flush(): void;
  /** Whether the way to a peer takes items of streams now. */
  mayPush(peer: Peer): boolean;
}

interface ServedObject {
  readonly path: string;
  readonly service: number;
  readonly skeleton: Skeleton;
}

/** A call that runs. The signal is made when its servant asks for it, which most do not. */
class Running {
  isAborted = false;
  wake: () => void = () => undefined;
  private controller: AbortController | undefined;

  get signal(): AbortSignal {
    this.controller ??= new AbortController();
    if (this.isAborted) this.controller.abort();
    return this.controller.signal;
  }
  abort(): void {
    this.isAborted = true;
    this.controller?.abort();
  }
}

const textSizeMax = 200;
const noBytes: Uint8Array = new Uint8Array(0);

/** Runs the calls of a server's objects, and those of the session's own service. */
export class Dispatcher {
  private readonly objects = new Map<number, ServedObject>();
  private readonly byPath = new Map<string, ServedObject>();
  private readonly running = new Map<Request, Running>();
  private lastService = 0;

  constructor(private readonly config: DispatcherConfig) {}

  add(path: string, skeleton: Skeleton): void {
    if (this.byPath.has(path)) throw new RangeError(`${path} is served already`);
    const object: ServedObject = { path, service: ++this.lastService, skeleton };
    this.objects.set(object.service, object);
    this.byPath.set(path, object);
  }
  remove(path: string): void {
    const object = this.byPath.get(path);
    if (object === undefined) return;
    this.byPath.delete(path);
    this.objects.delete(object.service);
  }
  /** The objects by their paths. */
  *catalog(): Generator<readonly [string, Interface]> {
    for (const [path, { skeleton }] of this.byPath) yield [path, skeleton.description];
  }
  get runningCount(): number {
    return this.running.size;
  }

  onEvent(source: RequestSource, event: ServerEvent): void {
    if (event.kind === "hang_up") return;
    if (event.kind === "run") return this.begin(source, event.request);
    const running = this.running.get(event.request);
    if (event.kind === "cancelled") running?.abort();
    running?.wake();
  }

  /** A connection takes frames again: streams look whether they may go on. */
  wakeStreams(): void {
    for (const running of this.running.values()) running.wake();
  }

  // ---- one call --------------------------------------------------------------------------------

  private begin(source: RequestSource, request: Request): void {
    const { header } = request;
    const refuse = (status: number, text = noBytes): void => {
      const now = this.config.clock.now();
      if (request.wantsReceipt) source.sessions.accept(request, status, now);
      source.sessions.complete(request, status, text, now);
      source.flush();
    };
    if (header.service === sessionService) {
      const [status, payload] = this.answerSession(source, request);
      return refuse(status, payload);
    }
    const object = this.objects.get(header.service);
    if (object === undefined) return refuse(Status.no_such_object);
    const operation = object.skeleton.operations.get(header.method);
    if (operation === undefined) return refuse(Status.no_such_method);
    if (this.running.size >= this.config.runningMax) return refuse(Status.overload);
    const isStream = operation.method.kind === "stream";
    if (isStream !== request.wantsStream) return refuse(Status.bad_request);
    const { maxSize = Infinity } = operation.method;
    if (request.payload.length > maxSize) return refuse(Status.too_large);
    let value: unknown;
    try {
      value = operation.method.request.decode(request.payload);
    } catch (error) {
      if (!(error instanceof BadValue)) this.config.onServantError(error, object.path);
      return refuse(Status.bad_request, textOf(error));
    }
    if (request.wantsReceipt) {
      source.sessions.accept(request, Status.ok, this.config.clock.now());
      source.flush();
    }
    void this.run(source, request, operation, value, `${object.path}.${operation.method.name}`);
  }

  private async run(
    source: RequestSource,
    request: Request,
    operation: AnyOperation,
    value: unknown,
    target: string,
  ): Promise<void> {
    const { clock } = this.config;
    const running = new Running();
    this.running.set(request, running);
    let cancelTimer = (): void => undefined;
    let status: number = Status.ok;
    let payload: Uint8Array = noBytes;
    try {
      const result: unknown = operation.run(value, this.contextOf(request, running));
      if (request.wantsStream) {
        status = await this.giveItems(source, request, running, operation, result);
      } else {
        // At its deadline the caller gives up without a word (hp-5.4-1).
        if (result instanceof Promise) {
          cancelTimer = clock.at(request.deadline, () => running.abort());
        }
        payload = operation.method.reply.encode(await result);
        if (payload.length > (operation.method.maxSize ?? Infinity)) {
          status = Status.too_large;
          payload = noBytes;
        }
      }
    } catch (error) {
      status = error instanceof Refusal ? Status[error.status] : Status.servant_failed;
      if (running.isAborted) status = Status.cancelled;
      const hasText = error instanceof Refusal && error.message !== "";
      const takesText = status === Status.bad_request || status === Status.servant_failed;
      payload = hasText && takesText ? textOf(error) : noBytes;
      if (status === Status.servant_failed && !(error instanceof Refusal)) {
        this.config.onServantError(error, target);
      }
    }
    cancelTimer();
    this.running.delete(request);
    source.sessions.complete(request, status, payload, clock.now());
    source.flush();
  }

  private contextOf(request: Request, running: Running): CallContext {
    const { clock } = this.config;
    return {
      priority: request.header.priority,
      get timeLeftMs() {
        if (request.deadline === never) return undefined;
        return Math.max(request.deadline - clock.now(), 0) / millisecond;
      },
      get signal() {
        return running.signal;
      },
      traceId: request.header.traceId,
    };
  }

  // Gives the items one by one, at the pace of the caller; returns the status of the end.
  private async giveItems(
    source: RequestSource,
    request: Request,
    running: Running,
    operation: AnyOperation,
    result: unknown,
  ): Promise<number> {
    const items = (result as AsyncIterable<unknown>)[Symbol.asyncIterator]();
    // One promise for each item: one for all would keep what each race leaves behind.
    const nextUnlessAborted = (): Promise<IteratorResult<unknown> | undefined> =>
      new Promise((resolve, reject) => {
        running.wake = () => {
          if (running.isAborted) resolve(undefined);
        };
        running.wake();
        items.next().then(resolve, reject);
      });
    try {
      for (;;) {
        const next = await nextUnlessAborted();
        if (next === undefined || running.isAborted) return Status.cancelled;
        if (next.done === true) break;
        const item = operation.method.reply.encode(next.value);
        if (item.length > (operation.method.maxSize ?? Infinity)) return Status.too_large;
        const status = await this.giveItem(source, request, running, item);
        if (status !== Status.ok) return status;
      }
    } finally {
      // Not awaited: a servant that heeds no signal may never come to its end.
      void items.return?.().catch(() => undefined);
    }
    // The reply would overtake the rest of an item.
    while (source.sessions.isItemPending(request) && !running.isAborted) {
      await new Promise<void>((resolve) => {
        running.wake = resolve;
      });
    }
    return Status.ok;
  }

  private async giveItem(
    source: RequestSource,
    request: Request,
    running: Running,
    item: Uint8Array,
  ): Promise<number> {
    for (;;) {
      if (running.isAborted) return Status.cancelled;
      const woken = new Promise<void>((resolve) => {
        running.wake = resolve;
      });
      const taken = source.mayPush(request.peer)
        ? source.sessions.pushItem(request, item, this.config.clock.now())
        : "no_credit";
      source.flush();
      if (taken === "taken") return Status.ok;
      if (taken === "too_large") return Status.too_large;
      if (taken === "gone") return Status.cancelled;
      await woken;
    }
  }

  // ---- the session's own service (spec/hprotocol.md, section 6) --------------------------------

  private answerSession(source: RequestSource, request: Request): [number, Uint8Array] {
    if (request.wantsStream) return [Status.no_such_method, noBytes];
    switch (request.header.method) {
      case SessionMethod.ping:
        return [Status.ok, noBytes];
      case SessionMethod.bind:
        return this.answerBind(request.payload);
      case SessionMethod.describe:
        return this.answerDescribe(request.payload, source.sessions.replySizeMax(request));
      default:
        return [Status.no_such_method, noBytes];
    }
  }

  private answerBind(payload: Uint8Array): [number, Uint8Array] {
    const asked = readBindRequest(payload);
    if (asked === undefined) return [Status.bad_request, noBytes];
    const object = this.byPath.get(asked.path);
    if (object === undefined) return [Status.no_such_object, this.similarPaths(asked.path)];
    const { description } = object.skeleton;
    if (asked.interfaceName !== description.name) {
      return [Status.wrong_interface, writeTexts([description.name])];
    }
    const reply = writeBindReply({
      service: object.service,
      priority: description.priority ?? 0,
      isServerDeclared: description.priorityModel === "server_declared",
      isMethodListComplete: true,
      fingerprint: description.fingerprint,
      methods: [...description.methods]
        .sort((a, b) => a.id - b.id)
        .map((method) => ({ id: method.id, fingerprint: method.fingerprint ?? 0 })),
    });
    return [Status.ok, reply];
  }

  private answerDescribe(payload: Uint8Array, sizeMax: number): [number, Uint8Array] {
    const service = readDescribeRequest(payload);
    if (service === undefined) return [Status.bad_request, noBytes];
    const object = this.objects.get(service);
    if (object === undefined) return [Status.no_such_object, noBytes];
    const text = object.skeleton.description.text;
    if (text === undefined) return [Status.no_such_method, noBytes];
    const bytes = utf8.encode(text);
    return bytes.length > sizeMax ? [Status.too_large, noBytes] : [Status.ok, bytes];
  }

  private similarPaths(path: string): Uint8Array {
    if (!isValidPath(path)) return noBytes;
    const paths = [...this.byPath.keys()];
    paths.sort((a, b) => similarity(path, b) - similarity(path, a));
    return writeTexts(paths.slice(0, 4));
  }
}

// Characters in common at both ends.
function similarity(a: string, b: string): number {
  const size = Math.min(a.length, b.length);
  let begin = 0;
  while (begin < size && a[begin] === b[begin]) begin += 1;
  let end = 0;
  while (end < size - begin && a.at(-1 - end) === b.at(-1 - end)) end += 1;
  return begin + end;
}

// hp-7-1: at most 200 bytes, whole characters.
function textOf(error: unknown): Uint8Array {
  const bytes = utf8.encode(error instanceof Error ? error.message : "");
  if (bytes.length <= textSizeMax) return bytes;
  let end = textSizeMax;
  while (end > 0 && (bytes[end]! & 0xc0) === 0x80) end -= 1;
  return bytes.subarray(0, end);
}

import {
  Action,
  DeliveryEntry,
  HubClient,
  HubInterface,
  SubscribeRequest,
  type Batch,
  type LossCounts,
} from "../../idl/events.rtpm.js";
import type { Binder } from "../client/binder.js";
import { pause } from "../client/binder.js";
import { printable } from "../core/bytes.js";
import { millisecond, second } from "../core/numbers.js";
import { readEvents, type HubEvent } from "./event.js";
import { EventFilter, entryOf } from "./filter.js";

export interface EventConsumerOptions {
  /** The consumer's name in the hub's report; default "typescript". */
  readonly name?: string;
  /** Which events; default all. */
  readonly filter?: EventFilter;
  /**
   * How many events wait here and, behind these, at the hub, 1 to 4096; default 256. Beyond them
   * the hub drops the oldest, and `lost` counts these.
   */
  readonly window?: number;
  /** Closes the consumer. */
  readonly signal?: AbortSignal;
}

const eventSizeMax = 16 * 1024 * 1024;
const retryInterval = 300 * millisecond;
const noteInterval = second;

/** Puts events together that are larger than an item of the stream. */
class Assembly {
  private bytes: Uint8Array | undefined;
  private filled = 0;

  /** The events of an item; undefined if a part is missing; "malformed". */
  take({ events, part }: Batch): Uint8Array | undefined | "malformed" {
    if (part === undefined) return events;
    if (part.offset === 0 && part.size <= eventSizeMax) {
      this.bytes = new Uint8Array(part.size);
      this.filled = 0;
    }
    const whole = this.bytes;
    const fits =
      whole?.length === part.size &&
      part.offset === this.filled &&
      events.length <= part.size - this.filled;
    if (whole === undefined || !fits) {
      this.bytes = undefined;
      return "malformed";
    }
    whole.set(events, this.filled);
    this.filled += events.length;
    if (this.filled < whole.length) return undefined;
    this.bytes = undefined;
    return whole;
  }
}

/**
 * A subscription at a hub: `for await (const event of consumer)`. It subscribes again by itself when
 * the hub was restarted or unreachable. Close it or its node, or declare it with `await using`;
 * leaving a loop does not end it, and events that come meanwhile wait in its window.
 */
export class EventConsumer implements AsyncIterable<HubEvent>, AsyncDisposable {
  private readonly closing = new AbortController();
  private isClosed = false;
  private readonly events: HubEvent[] = [];
  private wakeReader = (): void => undefined;
  private wakeLoops: (() => void)[] = [];
  private subscription = 0n;
  private receivedCount = 0n;
  private lostCount = 0n;
  private malformedCount = 0;
  private troubleText = "not subscribed yet";
  private readonly disown: () => void;

  private constructor(
    private readonly binder: Binder,
    private readonly hub: HubClient,
    private readonly request: SubscribeRequest,
    private readonly window: number,
  ) {
    this.disown = binder.own(this);
  }

  /**
   * Subscribes; resolves when the hub has the subscription.
   * @param hub  its name, usually "rtpm/events", or its address
   * @throws CallError or NameError if the hub cannot be bound; Error if it refuses the filter
   */
  static async open(
    binder: Binder,
    hub: string,
    options: EventConsumerOptions = {},
  ): Promise<EventConsumer> {
    const { filter = EventFilter.everything(), window = 256, name = "typescript" } = options;
    if (!(window >= 1 && window <= 4096)) {
      throw new RangeError(`a consumer's window is 1 to 4096 events, not ${window}`);
    }
    const request = SubscribeRequest.of({
      name,
      filter: filter.node,
      delivery: DeliveryEntry.of({ queueCapacity: window }),
      types: filter.types.map(entryOf),
      program: "typescript",
    });
    const { signal } = options;
    const binding = await binder.bind(hub, HubInterface, signal === undefined ? {} : { signal });
    const consumer = new EventConsumer(binder, new HubClient(binding), request, window);
    signal?.addEventListener("abort", () => void consumer.close(), { once: true });
    await new Promise<void>((resolve, reject) => {
      void consumer.run(resolve, reject);
      if (signal?.aborted === true) void consumer.close();
    });
    return consumer;
  }

  /** How many events were given to the program. */
  get received(): bigint {
    return this.receivedCount;
  }
  /** How many accepted events the hub could not deliver: too large, or too fast for this. */
  get lost(): bigint {
    return this.lostCount;
  }
  /** How many items of the hub were malformed. */
  get malformed(): number {
    return this.malformedCount;
  }
  /** Why it is not subscribed now; empty if it is. */
  get trouble(): string {
    return this.troubleText;
  }

  /** The events, one by one, until the consumer is closed. */
  async *[Symbol.asyncIterator](): AsyncGenerator<HubEvent, void> {
    while (!this.isClosed) {
      const event = this.events.shift();
      if (event !== undefined) {
        this.receivedCount += 1n;
        this.wakeReader();
        yield event;
        continue;
      }
      await new Promise<void>((resolve) => this.wakeLoops.push(resolve));
    }
  }

  /** Ends the loops over it at once, and then the subscription. */
  async close(): Promise<void> {
    if (this.isClosed) return;
    this.isClosed = true;
    this.disown();
    this.troubleText = "closed";
    this.wake();
    const { subscription } = this;
    // Without an answer the hub notices the end of the stream.
    const ending = subscription === 0n ? undefined : { subscription, action: Action.End };
    if (ending !== undefined) await this.hub.control(ending).catch(() => undefined);
    this.closing.abort();
    this.wakeReader();
  }
  [Symbol.asyncDispose](): Promise<void> {
    return this.close();
  }

  private wake(): void {
    for (const wake of this.wakeLoops.splice(0)) wake();
  }

  // One life of the subscription after the other.
  private async run(onBegun: () => void, onRefused: (error: unknown) => void): Promise<void> {
    const { signal } = this.closing;
    const { clock } = this.binder;
    let hasBegun = false;
    const begun = (): void => {
      hasBegun = true;
      onBegun();
    };
    while (!this.isClosed) {
      try {
        await this.read(begun);
      } catch (error) {
        if (this.isClosed) break;
        this.troubleText = error instanceof Error ? error.message : String(error);
        if (!hasBegun) {
          this.isClosed = true;
          this.disown();
          return onRefused(error);
        }
      }
      this.subscription = 0n;
      await pause(clock, retryInterval, signal).catch(() => undefined);
    }
    if (!hasBegun) onRefused(new Error("the consumer was closed"));
  }

  private async read(begun: () => void): Promise<void> {
    const { signal } = this.closing;
    const assembly = new Assembly();
    let lostBefore = 0n;
    let stopNotes = (): void => undefined;
    try {
      for await (const batch of this.hub.subscribe(this.request, { signal })) {
        if (batch.refusal !== "") throw new Error(`the hub says: ${printable(batch.refusal)}`);
        if (batch.welcome !== undefined) {
          this.subscription = batch.welcome.subscription;
          this.troubleText = "";
          stopNotes = this.noteRegularly();
          begun();
        }
        if (batch.losses !== undefined) {
          const lost = total(batch.losses);
          if (lost > lostBefore) this.lostCount += lost - lostBefore;
          lostBefore = lost;
        }
        await this.give(assembly.take(batch));
      }
      this.troubleText = "the hub ended the subscription";
    } finally {
      stopNotes();
    }
  }

  private async give(bytes: Uint8Array | undefined | "malformed"): Promise<void> {
    if (bytes === undefined) return;
    const { events, isBroken } =
      bytes === "malformed" ? { events: [], isBroken: true } : readEvents(bytes);
    if (isBroken) this.malformedCount += 1;
    this.events.push(...events);
    if (events.length > 0) this.wake();
    // Without credit the hub keeps what follows.
    while (this.events.length >= this.window && !this.isClosed) {
      await new Promise<void>((resolve) => {
        this.wakeReader = resolve;
      });
    }
  }

  // ev-4: what the hub cannot see.
  private noteRegularly(): () => void {
    const { clock } = this.binder;
    let cancel = (): void => undefined;
    const note = (): void => {
      try {
        const { subscription, receivedCount: received } = this;
        this.hub.note({ subscription, received, lagNs: 0n, lost: 0n });
      } catch {
        // The stream's own failure says more.
      }
      cancel = clock.at(clock.now() + noteInterval, note);
    };
    note();
    return () => cancel();
  }
}

function total(losses: LossCounts): bigint {
  return losses.overflow + losses.replaced + losses.suspended + losses.memory + losses.tooLarge;
}

import {
  AttendRequest,
  HubClient,
  HubInterface,
  type AttendReply,
  type SupplierCounts,
} from "../../idl/events.rtpm.js";
import type { Binder } from "../client/binder.js";
import { printable } from "../core/bytes.js";
import { millisecond } from "../core/numbers.js";
import type { CallOptions } from "../values/caller.js";
import type { EventType } from "../values/method.js";
import { writeEvent } from "./event.js";
import { entryOf } from "./filter.js";

/** Where the hub's clock is, seen from this program's. */
interface ClockDifference {
  readonly offsetNs: number;
  readonly uncertaintyNs: number;
}

/** How many types and sources a supplier counts sequences for. */
const countedMax = 65536;

/** Pushes events to a hub. An event is a oneway: it may get lost, and nothing waits for it. */
export class EventSupplier {
  private readonly sequences = new Map<string, bigint>();

  private constructor(
    private readonly binder: Binder,
    private readonly hub: HubClient,
    private readonly attendance: AttendRequest,
    private readonly difference: ClockDifference,
  ) {}

  /**
   * Binds a hub, and states the types to it.
   * @param hub  its name, usually "rtpm/events", or its address
   * @param name  of the supplier, for the hub's report
   * @throws CallError or NameError if the hub cannot be bound; Error if it refuses a type
   */
  static async open(
    binder: Binder,
    hub: string,
    name: string,
    // eslint-disable-next-line @typescript-eslint/no-explicit-any
    types: readonly EventType<any>[],
    options: CallOptions = {},
  ): Promise<EventSupplier> {
    const client = new HubClient(await binder.bind(hub, HubInterface, options));
    const [supplier] = globalThis.crypto.getRandomValues(new BigUint64Array(1));
    const attendance = AttendRequest.of({ supplier: supplier!, name, types: types.map(entryOf) });
    const difference = await differenceOf(binder, client, options);
    const opened = new EventSupplier(binder, client, attendance, difference);
    await opened.attend(options);
    return opened;
  }

  /**
   * Pushes an event that happens now.
   * @param source  tells the suppliers of one type apart
   * @throws CallError if it does not fit one frame: about 1200 bytes over UDP, 64 KiB over TCP;
   *   BadValue for a value that the type cannot hold
   */
  push<T>(type: EventType<T>, source: number, value: T): void {
    const { offsetNs, uncertaintyNs } = this.difference;
    const payload = type.codec.encode(value);
    const head = {
      type: type.type,
      source,
      sequence: this.nextSequence(type.type, source),
      originNs: BigInt(Math.round(this.binder.clock.now() + offsetNs)),
      uncertaintyNs: Math.round(uncertaintyNs),
      schemaId: type.schemaId,
    };
    const { supplier } = this.attendance;
    this.hub.push({ supplier, events: writeEvent(head, payload) });
  }

  /** The hub's counts of this supplier's events. Also states the types to a restarted hub. */
  async counts(options: CallOptions = {}): Promise<SupplierCounts> {
    return (await this.attend(options)).counts;
  }

  private async attend(options: CallOptions): Promise<AttendReply> {
    const reply = await this.hub.attend(this.attendance, options);
    if (reply.refusal === "") return reply;
    throw new Error(`the hub refuses the types: ${printable(reply.refusal)}`);
  }

  // Beyond the limit events are not counted (ev-2), so that memory is bounded.
  private nextSequence(type: number, source: number): bigint {
    const key = `${type} ${source}`;
    const known = this.sequences.get(key);
    if (known === undefined && this.sequences.size >= countedMax) return 0n;
    const next = (known ?? 0n) + 1n;
    this.sequences.set(key, next);
    return next;
  }
}

// ev-3: times of origin are on the hub's clock.
async function differenceOf(
  { clock, clockDomain }: Binder,
  hub: HubClient,
  options: CallOptions,
): Promise<ClockDifference> {
  const before = clock.now();
  const facts = await hub.about(options);
  const after = clock.now();
  if (clockDomain !== 0n && clockDomain === facts.clockDomain) {
    return { offsetNs: 0, uncertaintyNs: 0 };
  }
  const middle = before + (after - before) / 2;
  // Clocks of two hosts drift apart by some 0.1 ms in a second.
  return {
    offsetNs: Number(facts.timeNs) - middle,
    uncertaintyNs: (after - before) / 2 + millisecond,
  };
}

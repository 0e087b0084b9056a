import { ackLaterCount, type FragmentAck } from "./control.js";
import { fragmentSizeOf, frameOf, type Header } from "./header.js";
import { Flag, FrameKind } from "./numbers.js";

// Messages larger than a frame (spec/hprotocol.md, 5.6).

/** The fragments of a message that have arrived. */
class FragmentSet {
  firstMissing = 0;
  private readonly isThere: Uint8Array;

  constructor(readonly count: number) {
    this.isThere = new Uint8Array(count);
  }

  has(index: number): boolean {
    return this.isThere[index] === 1;
  }
  /** Returns false if the fragment was there. */
  insert(index: number): boolean {
    if (this.has(index)) return false;
    this.isThere[index] = 1;
    while (this.firstMissing < this.count && this.has(this.firstMissing)) this.firstMissing += 1;
    return true;
  }
  isComplete(): boolean {
    return this.firstMissing === this.count;
  }
}

/** The ACK that says nothing is missing. */
export function ackOfAll(count: number): FragmentAck {
  return { firstMissing: count, later: new Uint8Array(ackLaterCount / 8) };
}

/** Puts one message together from fragments in any order. */
export class IncomingMessage {
  readonly message: Uint8Array;
  private readonly fragmentSize: number;
  private readonly arrived: FragmentSet;

  /** @param header  of any of its fragments; the message's size is within the limits */
  constructor(private readonly header: Header) {
    this.message = new Uint8Array(header.messageSize);
    this.fragmentSize = fragmentSizeOf(header);
    this.arrived = new FragmentSet(header.fragmentCount);
  }

  /** `foreign`: not of this message (hp-5.6-9). */
  take(header: Header, payload: Uint8Array): "new" | "duplicate" | "last" | "foreign" {
    const flags = Flag.noReply | Flag.replyOnReceipt;
    const isOurs =
      header.messageSize === this.message.length &&
      header.fragmentCount === this.arrived.count &&
      fragmentSizeOf(header) === this.fragmentSize &&
      header.service === this.header.service &&
      header.method === this.header.method &&
      header.priority === this.header.priority &&
      header.item === this.header.item &&
      ((header.flags ^ this.header.flags) & flags) === 0;
    if (!isOurs) return "foreign";
    if (!this.arrived.insert(header.fragmentIndex)) return "duplicate";
    this.message.set(payload, header.fragmentIndex * this.fragmentSize);
    return this.arrived.isComplete() ? "last" : "new";
  }

  ack(): FragmentAck {
    const ack = ackOfAll(this.arrived.firstMissing);
    for (let i = 0; i < ackLaterCount; i += 1) {
      const index = ack.firstMissing + 1 + i;
      if (index >= this.arrived.count) break;
      if (this.arrived.has(index)) ack.later[i >> 3]! |= 1 << (i & 7);
    }
    return ack;
  }
}

/**
 * Sends one message in fragments, a window at a time, and again those that an ACK shows to be lost.
 * It has no timer: nudge() makes the first unacknowledged fragment due again.
 */
export class OutgoingMessage {
  private readonly acknowledged: FragmentSet;
  private readonly header: Header;
  private nextNew = 0;
  private repairNext = 0;
  private repairEnd = 0;

  /** @param message  not changed until the end */
  constructor(
    header: Header,
    private readonly message: Uint8Array,
    private readonly fragmentSize: number,
    private readonly window: number,
  ) {
    const fragmentCount = Math.ceil(message.length / fragmentSize);
    this.acknowledged = new FragmentSet(fragmentCount);
    this.header = { ...header, fragmentCount, messageSize: message.length };
  }

  isAcknowledged(): boolean {
    return this.acknowledged.isComplete();
  }

  /** The next frame that may be sent now; undefined if none may. */
  next(budgetUs: number, now: number): Uint8Array | undefined {
    const newBefore = this.nextNew;
    const index = this.choose();
    if (index === undefined) return undefined;
    let flags = index < newBefore ? Flag.repeated : 0;
    const half = this.window / 2;
    // hp-5.6-3
    if (!this.hasMore() || index % half === half - 1) flags |= Flag.ackWanted;
    return this.write(index, flags, budgetUs, now);
  }

  /** The first fragment again, to learn what became of the call (hp-5.6-7). */
  firstAgain(budgetUs: number, now: number): Uint8Array {
    return this.write(0, Flag.repeated | Flag.ackWanted, budgetUs, now);
  }

  /** @param isAsked  the receiver heard nothing for a while: something is sent in any case */
  onAck(ack: FragmentAck, isAsked: boolean): void {
    // An ACK of what was never sent is forged or faulty.
    if (ack.firstMissing > this.nextNew) return;
    for (let i = this.acknowledged.firstMissing; i < ack.firstMissing; i += 1) {
      this.acknowledged.insert(i);
    }
    let end = ack.firstMissing;
    for (let i = 0; i < ackLaterCount; i += 1) {
      const index = ack.firstMissing + 1 + i;
      if (index >= this.nextNew) break;
      if (((ack.later[i >> 3]! >> (i & 7)) & 1) === 0) continue;
      this.acknowledged.insert(index);
      end = index;
    }
    // hp-5.6-6
    this.repairNext = this.acknowledged.firstMissing;
    this.repairEnd = Math.max(end, this.repairNext);
    if (isAsked && !this.hasMore()) this.nudge();
  }

  nudge(): void {
    if (this.isAcknowledged()) return;
    this.repairNext = this.acknowledged.firstMissing;
    this.repairEnd = Math.min(this.repairNext + 1, this.nextNew);
  }

  private hasMore(): boolean {
    for (let i = this.repairNext; i < this.repairEnd; i += 1) {
      if (!this.acknowledged.has(i)) return true;
    }
    const windowEnd = this.acknowledged.firstMissing + this.window; // hp-5.6-2
    return this.nextNew < Math.min(this.acknowledged.count, windowEnd);
  }

  private choose(): number | undefined {
    while (this.repairNext < this.repairEnd) {
      const index = this.repairNext++;
      if (!this.acknowledged.has(index)) return index;
    }
    return this.hasMore() ? this.nextNew++ : undefined;
  }

  private write(index: number, flags: number, budgetUs: number, now: number): Uint8Array {
    const at = index * this.fragmentSize;
    const part = this.message.subarray(at, at + this.fragmentSize);
    const header: Header = {
      ...this.header,
      flags: this.header.flags | flags,
      fragmentIndex: index,
      payloadSize: part.length,
      senderTimeNs: BigInt(Math.trunc(now)),
    };
    // A CALL states what is left, a REPLY how long its method took.
    if (header.kind === FrameKind.CALL) header.budgetUs = budgetUs;
    return frameOf(header, part);
  }
}

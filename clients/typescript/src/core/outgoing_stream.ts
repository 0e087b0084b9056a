import { ahead, wrap } from "./bytes.js";
import type { StreamCredit } from "./control.js";
import { frameOf, markRepeated, type Header } from "./header.js";
import { FrameKind, streamBytesFirst, streamWindowMax, type Medium } from "./numbers.js";

/**
 * The server's end of a stream (spec/hprotocol.md, 5.10): numbers the frames of its items, keeps
 * them over datagrams, and sends lost ones again. Time is the client's affair.
 */
export class OutgoingStream {
  /** Frames sent, modulo 2^32. */
  count = 0;
  private readonly header: Header;
  private readonly kept = new Map<number, Uint8Array>();
  private readonly isKept: boolean;
  private itemCount = 0;
  private itemLimit: number;
  private byteCount = 0;
  private byteLimit: number;
  private firstMissing = 0;
  private repairs = 0n; // bit i: frame firstMissing + i is lost

  /** @param call  the header of the stream's CALL */
  constructor(
    call: Header,
    private readonly fragmentSize: number,
    medium: Medium,
  ) {
    this.header = {
      ...call,
      kind: FrameKind.ITEM,
      flags: 0,
      status: 0,
      budgetUs: 0,
      fragmentIndex: 0,
      fragmentCount: 1,
    };
    this.isKept = medium === "datagram";
    this.itemLimit = call.item;
    this.byteLimit = streamBytesFirst(medium);
  }

  /** Whether an item was sent in part only. */
  isMidway(): boolean {
    return this.header.fragmentIndex > 0;
  }
  isAcknowledged(): boolean {
    return this.firstMissing === this.count;
  }

  /**
   * The next frame of the item; undefined if its client takes no more now (hp-5.10-2, hp-5.10-9).
   * @param item  the same bytes until isMidway() is false
   */
  push(item: Uint8Array, now: number): Uint8Array | undefined {
    if (!this.isMidway() && ahead(this.itemLimit, this.itemCount) <= 0) return undefined;
    if (this.isKept && wrap(this.count - this.firstMissing) >= streamWindowMax) return undefined;
    const at = this.header.fragmentIndex * this.fragmentSize;
    const part = item.subarray(at, at + this.fragmentSize);
    if (ahead(this.byteLimit, this.byteCount) < part.length) return undefined;
    if (!this.isMidway()) {
      this.header.messageSize = item.length;
      this.header.fragmentCount = Math.max(Math.ceil(item.length / this.fragmentSize), 1);
      this.header.senderTimeNs = BigInt(Math.trunc(now));
      this.itemCount = wrap(this.itemCount + 1);
    }
    this.header.payloadSize = part.length;
    this.header.item = this.count;
    const frame = frameOf(this.header, part);
    if (this.isKept) this.kept.set(this.count, frame);
    this.byteCount = wrap(this.byteCount + part.length);
    this.count = wrap(this.count + 1);
    this.header.fragmentIndex = (this.header.fragmentIndex + 1) % this.header.fragmentCount;
    if (!this.isKept) this.firstMissing = this.count;
    return frame;
  }

  /** @param isAsked  the client heard nothing for a while */
  onCredit(credit: StreamCredit, itemLimit: number, isAsked: boolean): void {
    if (ahead(credit.firstMissing, this.count) > 0) return; // hp-5.10-8
    if (ahead(itemLimit, this.itemLimit) > 0) this.itemLimit = itemLimit;
    if (ahead(credit.byteLimit, this.byteLimit) > 0) this.byteLimit = credit.byteLimit;
    if (!this.isKept || ahead(credit.firstMissing, this.firstMissing) < 0) return;
    for (
      ;
      this.firstMissing !== credit.firstMissing;
      this.firstMissing = wrap(this.firstMissing + 1)
    ) {
      this.kept.delete(this.firstMissing);
    }
    const sent = wrap(this.count - this.firstMissing);
    const known = credit.later === 0n ? 0 : credit.later.toString(2).length;
    const lostEnd = Math.min(known, sent);
    // hp-5.10-4: what is missing before a frame that is there is lost.
    this.repairs = ((1n << BigInt(lostEnd)) - 1n) & ~(credit.later << 1n);
    if (isAsked && sent > 0) this.repairs |= 1n;
  }

  /** The next lost frame, marked as a copy. */
  nextRepair(): Uint8Array | undefined {
    for (let bit = 0; this.repairs >> BigInt(bit) !== 0n; bit += 1) {
      const mask = 1n << BigInt(bit);
      if ((this.repairs & mask) === 0n) continue;
      this.repairs &= ~mask;
      const frame = this.kept.get(wrap(this.firstMissing + bit));
      if (frame === undefined) continue;
      markRepeated(frame);
      return frame;
    }
    return undefined;
  }
}

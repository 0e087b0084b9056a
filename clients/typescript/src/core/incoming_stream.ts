import { ahead, concat, wrap } from "./bytes.js";
import type { StreamCredit } from "./control.js";
import { fragmentSizeOf, type Header } from "./header.js";
import { messageSizeFloor, streamBytesFirst, type Medium } from "./numbers.js";

/** A frame that arrived, as far as it matters for its item. */
interface Part {
  payload: Uint8Array;
  index: number;
  count: number;
  messageSize: number;
  fragmentSize: number; // 0: the frame is a whole item
}

const streamPayloadSizeLeast = 16320; // hp-5.10-11, over a stream medium

/**
 * The client's end of a stream (spec/hprotocol.md, 5.10): orders frames, and puts items together.
 * A frame counts as taken when its item is, or when it is moved to a larger item.
 */
export class IncomingStream {
  /** Frames that turned out not to continue the current item, and were dropped late. */
  droppedCount = 0;
  /** Frames that are done with. */
  freedCount = 0;
  isEnded = false;
  private readonly byteWindow: number;
  private readonly slotCount: number;
  private readonly parts = new Map<number, Part>();
  private firstMissing = 0;
  private present = 0n; // bit i: frame firstMissing + 1 + i is there
  private end = 0;
  private expected: Part | undefined; // the next fragment of the current item
  private readyCount = 0;
  private itemCount = 0; // items that the reader is done with
  private keptBytes = 0;
  private freedBytes = 0;
  private fragments: Uint8Array[] = []; // of the item that is put together
  private isWhole = false;
  private view: "none" | "frame" | "item" = "none";

  /** @param window  items that are taken at a time, 1 to 32 */
  constructor(
    medium: Medium,
    private readonly window: number,
    private readonly itemSizeMax: number,
  ) {
    this.byteWindow = streamBytesFirst(medium);
    const least = medium === "datagram" ? messageSizeFloor : streamPayloadSizeLeast;
    this.slotCount = window + Math.ceil(this.byteWindow / least);
  }

  /** Whether the frame `number` would show a gap before it that nothing showed before. */
  revealsGap(number: number): boolean {
    return ahead(number, this.knownEnd()) > 0;
  }
  isMidway(): boolean {
    return this.expected !== undefined;
  }
  isComplete(): boolean {
    return this.isEnded && this.firstMissing === this.end;
  }
  hasNext(): boolean {
    return this.readyCount > 0;
  }
  /** Items below this number may come. */
  limit(): number {
    return wrap(this.itemCount + this.window);
  }
  credit(): StreamCredit {
    return {
      firstMissing: this.firstMissing,
      byteLimit: wrap(this.freedBytes + this.byteWindow),
      later: this.present,
    };
  }
  /** Whether a CREDIT is worth sending, compared with what the last one said (hp-5.10-4). */
  isCreditDue(limitSent: number, byteLimitSent: number, freedSent: number): boolean {
    return (
      2 * wrap(this.limit() - limitSent) >= this.window ||
      this.freedCount - freedSent >= 16 ||
      2 * ahead(this.credit().byteLimit, byteLimitSent) >= this.byteWindow
    );
  }

  /** `foreign`: was not granted, or is not of the current item (hp-5.10-11). */
  take(header: Header, payload: Uint8Array): "new" | "ahead" | "duplicate" | "foreign" {
    const distance = ahead(header.item, this.firstMissing);
    if (distance < 0) return "duplicate";
    const kept = wrap(header.item - wrap(this.freedCount));
    if (distance > 64 || kept >= this.slotCount) return "foreign";
    if (this.isEnded && ahead(header.item, this.end) >= 0) return "foreign";
    const bit = distance === 0 ? 0n : 1n << BigInt(distance - 1);
    if ((this.present & bit) !== 0n) return "duplicate";
    const part: Part = {
      payload,
      index: header.fragmentIndex,
      count: header.fragmentCount,
      messageSize: header.messageSize,
      fragmentSize: header.fragmentCount > 1 ? fragmentSizeOf(header) : 0,
    };
    if (this.keptBytes + payload.length > this.byteWindow) return "foreign"; // hp-5.10-9
    if (distance === 0 && !this.fits(part)) return "foreign";
    this.parts.set(header.item, { ...part, payload: payload.slice() });
    this.keptBytes += payload.length;
    this.present |= bit;
    if (distance > 0) return "ahead";
    this.accept(part);
    this.acceptWaiting();
    this.putTogether();
    return "new";
  }

  /** Takes the number of all frames; false if it contradicts what came. */
  endAt(count: number): boolean {
    if (this.isEnded) return count === this.end;
    const kept = wrap(count - wrap(this.freedCount));
    if (ahead(count, this.knownEnd()) < 0 || kept > this.slotCount) return false;
    this.isEnded = true;
    this.end = count;
    return true;
  }

  /** The next item, the reader's to keep; undefined if none is complete. */
  next(): Uint8Array | undefined {
    // The item before counts as taken only now, so that a slow reader holds its credit back.
    if (this.view !== "none") {
      if (this.view === "frame") this.free();
      this.view = "none";
      this.itemCount = wrap(this.itemCount + 1);
      this.putTogether();
    }
    if (!this.hasNext()) return undefined;
    this.readyCount -= 1;
    if (this.isWhole) {
      this.view = "item";
      const item = concat(...this.fragments);
      this.fragments = [];
      this.isWhole = false;
      return item;
    }
    this.view = "frame";
    return this.parts.get(wrap(this.freedCount))?.payload;
  }

  private fits(part: Part): boolean {
    const expected = this.expected;
    if (expected === undefined) {
      return part.index === 0 && (part.count === 1 || part.messageSize <= this.itemSizeMax);
    }
    return (
      part.index === expected.index &&
      part.count === expected.count &&
      part.messageSize === expected.messageSize &&
      part.fragmentSize === expected.fragmentSize
    );
  }

  private accept(part: Part): void {
    this.firstMissing = wrap(this.firstMissing + 1);
    this.expected = { ...part, payload: new Uint8Array(0), index: part.index + 1 };
    if (this.expected.index < part.count) return;
    this.expected = undefined;
    this.readyCount += 1;
  }

  // Frames that were ahead may now be next in order.
  private acceptWaiting(): void {
    for (;;) {
      const isThere = (this.present & 1n) !== 0n;
      this.present >>= 1n;
      const part = isThere ? this.parts.get(this.firstMissing) : undefined;
      if (part === undefined) return;
      if (!this.fits(part)) {
        this.keptBytes -= part.payload.length;
        this.parts.delete(this.firstMissing);
        this.droppedCount += 1;
        return;
      }
      this.accept(part);
    }
  }

  private knownEnd(): number {
    if (this.present === 0n) return this.firstMissing;
    return wrap(this.firstMissing + this.present.toString(2).length + 1);
  }

  private free(): void {
    const number = wrap(this.freedCount);
    const size = this.parts.get(number)?.payload.length ?? 0;
    this.parts.delete(number);
    this.keptBytes -= size;
    this.freedBytes = wrap(this.freedBytes + size);
    this.freedCount += 1;
  }

  // Moves fragments, in order, to their item; not while the reader holds one.
  private putTogether(): void {
    while (!this.isWhole && this.view === "none" && wrap(this.freedCount) !== this.firstMissing) {
      const part = this.parts.get(wrap(this.freedCount));
      if (part === undefined || part.count === 1) return;
      this.fragments.push(part.payload);
      this.isWhole = part.index + 1 === part.count;
      this.free();
    }
  }
}

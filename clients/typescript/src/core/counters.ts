import type { DropReason } from "./numbers.js";

/** How often each thing happened, for diagnosis. Every dropped frame is counted (hp-8-1). */
export class FrameCounters {
  receivedCount = 0;
  /** Dropped frames by their reason. */
  readonly dropped = new Map<DropReason, number>();
  sessionOpenedCount = 0;
  sessionEvictedCount = 0;
  refusedCount = 0;
  expiredCount = 0;
  cancelledCount = 0;
  /** Results of calls whose session had ended. */
  orphanedCount = 0;

  drop(reason: DropReason): void {
    this.dropped.set(reason, (this.dropped.get(reason) ?? 0) + 1);
  }
}

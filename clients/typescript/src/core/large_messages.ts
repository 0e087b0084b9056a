import type { IncomingMessage, OutgoingMessage } from "./fragments.js";
import { largeMessageSilenceMax, never } from "./numbers.js";
import { shareOfOneHost, type Peer } from "./peer.js";

/** A server's message larger than a frame: a request that comes or runs, or a reply that goes. */
export interface LargeMessage<Owner> {
  readonly owner: Owner;
  readonly peer: Peer;
  readonly deadline: number;
  /** When its client last sent a frame about it. */
  heard: number;
  /** A request; complete while its method runs. */
  incoming?: IncomingMessage;
  isComplete: boolean;
  outgoing?: OutgoingMessage;
}

/** The large messages of a server, so many at a time (hp-5.6-10, hp-5.6-11). */
export class LargeMessages<Owner> {
  private readonly messages = new Set<LargeMessage<Owner>>();
  /** Whether a place was freed since it was last set to false. */
  hasFreed = false;

  constructor(readonly capacity: number) {}

  /** A place for a message of that peer: `free`, the message to evict, or none. */
  find(peer: Peer, now: number): "free" | LargeMessage<Owner> | undefined {
    let idle: LargeMessage<Owner> | undefined;
    let ownIdle: LargeMessage<Owner> | undefined;
    let ownCount = 0;
    for (const message of this.messages) {
      const isOwn = message.peer.host === peer.host;
      ownCount += isOwn ? 1 : 0;
      if (this.idleTime(message) > now) continue;
      if (idle === undefined || message.heard < idle.heard) idle = message;
      if (isOwn && (ownIdle === undefined || message.heard < ownIdle.heard)) ownIdle = message;
    }
    if (ownCount >= shareOfOneHost(this.capacity)) return ownIdle;
    return this.messages.size < this.capacity ? "free" : idle;
  }

  add(message: LargeMessage<Owner>): void {
    this.messages.add(message);
  }
  free(message: LargeMessage<Owner>): void {
    if (this.messages.delete(message)) this.hasFreed = true;
  }
  /** When, after `now`, the next message may be evicted. */
  nextIdleTime(now: number): number {
    let next = never;
    for (const message of this.messages) {
      const idle = this.idleTime(message);
      if (idle > now) next = Math.min(next, idle);
    }
    return next;
  }

  private idleTime(message: LargeMessage<Owner>): number {
    const isRunning = message.outgoing === undefined && message.isComplete;
    if (isRunning) return never;
    return Math.min(message.deadline, message.heard + largeMessageSilenceMax);
  }
}

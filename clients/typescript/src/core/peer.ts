/** Where a frame came from: an address, or a connection. */
export interface Peer {
  /** Unique for each address and port, or each connection. */
  readonly key: string;
  /** The host, for quotas; the addresses of one /64 are one host (hp-4-7). */
  readonly host: string;
}

/** One host's quota of `count`: three quarters, rounded up. */
export function shareOfOneHost(count: number): number {
  return count - Math.floor(count / 4);
}

const bucketCount = 64;

/** Limits answers to frames of no session: 256 at once for a host, then 500 a second (hp-4.4-5). */
export class StrangerLimit {
  private readonly fullUntil = new Float64Array(bucketCount);
  // Hosts share buckets by a secret hash, so that an attacker cannot choose whom it delays.
  private readonly seed: number;

  constructor(
    secret: Uint8Array,
    private readonly burst: number,
    private readonly intervalNs: number,
  ) {
    this.seed = secret[0]! * 0x01000193;
  }

  admit(peer: Peer, now: number): boolean {
    let hash = this.seed;
    for (let i = 0; i < peer.host.length; i += 1) {
      hash = Math.imul(hash ^ peer.host.charCodeAt(i), 0x01000193);
    }
    const index = (hash >>> 0) % bucketCount;
    const free = Math.max(this.fullUntil[index]!, now) + this.intervalNs;
    if (free - now > this.burst * this.intervalNs) return false;
    this.fullUntil[index] = free;
    return true;
  }
}

package org.rtpm.internal.wire;

/**
 * Where a frame comes from: equal values mean the same peer.
 *
 * @param high the first 64 bits of an IPv6 address, or of ::ffff:a.b.c.d for IPv4
 * @param low the rest of the address
 * @param port distinguishes the peers of a host: a port, or the number of a connection
 * @param hostHigh with hostLow: equal for all peers of one host (hp-4-7)
 */
public record Peer(long high, long low, long port, long hostHigh, long hostLow) {

  /** A peer whose address is its host. */
  public static Peer of(long high, long low, long port) {
    return new Peer(high, low, port, high, high == 0 ? low : 0);
  }

  boolean isSameHost(Peer other) {
    return hostHigh == other.hostHigh && hostLow == other.hostLow;
  }
}

package org.rtpm.internal.wire;

import java.util.Arrays;

/** Gives and checks cookies without keeping them (hp-4.2). */
public final class CookieJar {
  private final SipHash key;

  public CookieJar(SipHash key) {
    this.key = key;
  }

  public byte[] give(Peer peer, long clientEpoch, long now) {
    return make(peer, clientEpoch, now / Limits.COOKIE_SPAN);
  }

  /** Whether this jar gave the cookie to that peer and client less than two spans ago. */
  public boolean isGood(byte[] cookie, Peer peer, long clientEpoch, long now) {
    long span = now / Limits.COOKIE_SPAN;
    return Arrays.equals(cookie, make(peer, clientEpoch, span))
        || Arrays.equals(cookie, make(peer, clientEpoch, span - 1));
  }

  private byte[] make(Peer peer, long clientEpoch, long span) {
    byte[] cookie = new byte[Hello.COOKIE_SIZE];
    Bytes.put64(cookie, 0, key.hash(peer.high(), peer.low(), peer.port(), clientEpoch, span));
    Bytes.put64(cookie, 8, span);
    return cookie;
  }
}

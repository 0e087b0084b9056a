package org.rtpm.internal.sealed;

/** A key pair of X25519, 32 bytes each. */
public record KeyPair(byte[] privateKey, byte[] publicKey) {
  /** The pair of a private key. */
  public static KeyPair of(byte[] privateKey) {
    return new KeyPair(privateKey, Crypto.publicOf(privateKey));
  }

  /** Draws a new pair. */
  public static KeyPair draw() {
    return of(Crypto.random());
  }
}

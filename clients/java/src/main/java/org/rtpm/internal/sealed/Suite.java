package org.rtpm.internal.sealed;

import java.nio.charset.StandardCharsets;

/** A suite of sealed sessions (sec-2). */
public enum Suite {
  CHACHA_POLY("Noise_IKpsk2_25519_ChaChaPoly_SHA256", "chacha20-poly1305"),
  AES_GCM("Noise_IKpsk2_25519_AESGCM_SHA256", "aes-256-gcm");

  /** The suites of this program. The JDK's AES uses the CPU's instructions where it has them. */
  public static final int ALL = 3;

  final String protocolName;
  /** The name in a key log (sec-9). */
  final String cipherName;

  Suite(String protocolName, String cipherName) {
    this.protocolName = protocolName;
    this.cipherName = cipherName;
  }

  /** The suite's bit in COOKIE. */
  int bit() {
    return 1 << ordinal();
  }

  /** The features of a sealed HELLO with this suite (sec-3-2). */
  int features() {
    return Sealing.FEATURE_SEALED | (this == AES_GCM ? Sealing.FEATURE_AES_GCM : 0);
  }

  // sec-3.5: a name of at most 32 bytes is used as it is, a longer one is hashed.
  byte[] begin() {
    byte[] name = protocolName.getBytes(StandardCharsets.US_ASCII);
    return name.length == Crypto.KEY_SIZE ? name : Crypto.sha256(name);
  }
}

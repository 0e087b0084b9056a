package org.rtpm;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.Base64;
import org.rtpm.internal.sealed.KeyPair;

/** The private key of a program that seals its sessions. Keep it from others. */
public final class PrivateKey {
  private final KeyPair pair;

  private PrivateKey(KeyPair pair) {
    this.pair = pair;
  }

  /** Draws a new key. */
  public static PrivateKey draw() {
    return new PrivateKey(KeyPair.draw());
  }

  /**
   * Reads a key as text.
   *
   * @throws IllegalArgumentException if it is malformed
   */
  public static PrivateKey parse(String text) {
    return new PrivateKey(KeyPair.of(PublicKey.bytesOf(text)));
  }

  /** Reads the file of a key. */
  public static PrivateKey read(Path file) throws IOException {
    return parse(Files.readString(file));
  }

  /** The key by which others know this program. */
  public PublicKey publicKey() {
    return new PublicKey(pair.publicKey());
  }

  /** The key as text, to be written to a file that only its owner reads. */
  public String text() {
    return PublicKey.PREFIX + Base64.getEncoder().encodeToString(pair.privateKey());
  }

  KeyPair pair() {
    return pair;
  }

  /** Does not show the key. */
  @Override
  public String toString() {
    return "a private key";
  }
}

package org.rtpm;

import java.util.Arrays;
import java.util.Base64;

/** The public key of a program that seals its sessions (spec/security.md, section 2). */
public final class PublicKey {
  static final String PREFIX = "rtpm25519 ";
  static final int SIZE = 32;

  private final byte[] bytes;

  PublicKey(byte[] bytes) {
    this.bytes = bytes.clone();
  }

  /**
   * Reads a key such as {@code rtpm25519 FFpJPXuWjQLhFuVgHqGp6eVCWzCWQhx5LGbz2MgEDVo=},
   * which a comment may follow.
   *
   * @throws IllegalArgumentException if the text is malformed
   */
  public static PublicKey parse(String text) {
    return new PublicKey(bytesOf(text));
  }

  static byte[] bytesOf(String text) {
    String trimmed = text.trim();
    byte[] read = null;
    if (trimmed.startsWith(PREFIX)) {
      try {
        // A comment may follow.
        String encoded = trimmed.substring(PREFIX.length()).trim().split("\\s", 2)[0];
        read = Base64.getDecoder().decode(encoded);
      } catch (IllegalArgumentException e) {
        read = null;
      }
    }
    if (read == null || read.length != SIZE) {
      // Without the text: it may be a private key.
      throw new IllegalArgumentException(
          "a key is 'rtpm25519', a space, and 32 bytes in Base64; `rtpm key` makes one");
    }
    return read;
  }

  byte[] bytes() {
    return bytes;
  }

  @Override
  public boolean equals(Object other) {
    return other instanceof PublicKey key && Arrays.equals(bytes, key.bytes);
  }

  @Override
  public int hashCode() {
    return Arrays.hashCode(bytes);
  }

  /** The key as text. */
  @Override
  public String toString() {
    return PREFIX + Base64.getEncoder().encodeToString(bytes);
  }
}

package org.rtpm.internal.sealed;

import java.security.GeneralSecurityException;
import java.security.spec.AlgorithmParameterSpec;
import java.util.Arrays;
import javax.crypto.AEADBadTagException;
import javax.crypto.Cipher;
import javax.crypto.spec.GCMParameterSpec;
import javax.crypto.spec.IvParameterSpec;
import javax.crypto.spec.SecretKeySpec;

/** A key of a suite's cipher. One thread at a time. */
final class AeadKey {
  private static final int NONCE_SIZE = 12;

  private final Suite suite;
  private final SecretKeySpec key;
  private final byte[] nonce = new byte[NONCE_SIZE];
  private Cipher cipher;

  AeadKey(Suite suite, byte[] key) {
    this.suite = suite;
    this.key = new SecretKeySpec(key, suite == Suite.AES_GCM ? "AES" : "ChaCha20");
  }

  /** sec-5-5: the key of the next generation. */
  AeadKey next() {
    return new AeadKey(suite, nextBytes());
  }

  byte[] nextBytes() {
    byte[] sealed = seal(-1, new byte[0], new byte[Crypto.KEY_SIZE]);
    return Arrays.copyOf(sealed, Crypto.KEY_SIZE);
  }

  byte[] seal(long counter, byte[] associated, byte[] text) {
    return seal(counter, associated, associated.length, text, 0, text.length);
  }

  /** Returns the ciphertext with the tag behind it. */
  byte[] seal(long counter, byte[] associated, int associatedSize, byte[] text, int at, int size) {
    try {
      begin(Cipher.ENCRYPT_MODE, counter);
      cipher.updateAAD(associated, 0, associatedSize);
      return cipher.doFinal(text, at, size);
    } catch (GeneralSecurityException e) {
      throw new IllegalStateException("this Java can't seal by " + suite.cipherName, e);
    }
  }

  /** Returns the text; null if the tag is wrong. */
  byte[] open(long counter, byte[] associated, int associatedSize, byte[] sealed) {
    try {
      begin(Cipher.DECRYPT_MODE, counter);
      cipher.updateAAD(associated, 0, associatedSize);
      return cipher.doFinal(sealed);
    } catch (AEADBadTagException e) {
      // The JDK refuses the nonce of the last use, but the right frame may come with it.
      cipher = null;
      return null;
    } catch (GeneralSecurityException e) {
      throw new IllegalStateException("this Java can't open by " + suite.cipherName, e);
    }
  }

  private void begin(int mode, long counter) throws GeneralSecurityException {
    boolean isAes = suite == Suite.AES_GCM;
    for (int i = 0; i < 8; ++i) {
      nonce[isAes ? NONCE_SIZE - 1 - i : 4 + i] = (byte) (counter >>> (8 * i));
    }
    if (cipher == null) {
      cipher = Cipher.getInstance(isAes ? "AES/GCM/NoPadding" : "ChaCha20-Poly1305");
    }
    AlgorithmParameterSpec parameters =
        isAes ? new GCMParameterSpec(8 * Crypto.TAG_SIZE, nonce) : new IvParameterSpec(nonce);
    cipher.init(mode, key, parameters);
  }
}

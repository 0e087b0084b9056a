package org.rtpm.internal.sealed;

import java.util.Arrays;

/**
 * One side of a handshake Noise_IKpsk2 (sec-3.5). The client calls {@link #writeMessage1} and
 * {@link #readMessage2}, the server {@link #readMessage1} and {@link #writeMessage2}; then both
 * have {@link #keys}. One thread at a time.
 */
public final class Noise {
  static final int MESSAGE_1_SIZE = 104;
  static final int MESSAGE_2_SIZE = 112;

  /** The keys of a session's directions, and the hash of its handshake. */
  public record Keys(Suite suite, byte[] client, byte[] server, byte[] handshakeHash) {}

  private static final byte[] NOTHING = new byte[0];

  private final Suite suite;
  private final byte[] ownPrivate;
  private final byte[] presharedKey;
  private byte[] serverPublic;
  private byte[] ephemeral;
  private byte[] otherEphemeral;
  private byte[] clientPublic;
  private byte[] hash;
  private byte[] chaining;
  private AeadKey key;
  private long counter;

  private Noise(Suite suite, byte[] ownPrivate, byte[] serverPublic, byte[] psk, byte[] prologue) {
    this.suite = suite;
    this.ownPrivate = ownPrivate;
    this.serverPublic = serverPublic;
    presharedKey = psk;
    hash = suite.begin();
    chaining = hash;
    mixHash(prologue);
    mixHash(serverPublic);
  }

  /**
   * The client's side.
   *
   * @param ephemeral a private key that is drawn for this handshake alone
   */
  public static Noise client(
      Suite suite,
      byte[] ownPrivate,
      byte[] serverPublic,
      byte[] psk,
      byte[] ephemeral,
      byte[] prologue) {
    Noise client = new Noise(suite, ownPrivate, serverPublic, psk, prologue);
    client.ephemeral = ephemeral;
    return client;
  }

  /** The server's side. */
  public static Noise server(Suite suite, KeyPair own, byte[] psk, byte[] prologue) {
    return new Noise(suite, own.privateKey(), own.publicKey(), psk, prologue);
  }

  /**
   * Writes message 1.
   *
   * @param payload 8 bytes: the client's former session, or 0
   * @return null if the server's key is of small order
   */
  public byte[] writeMessage1(byte[] payload) {
    byte[] ephemeralPublic = Crypto.publicOf(ephemeral);
    mixHash(ephemeralPublic);
    mixKey(ephemeralPublic);
    if (!mixShared(ephemeral, serverPublic)) {
      return null;
    }
    byte[] encryptedStatic = encrypt(Crypto.publicOf(ownPrivate));
    if (!mixShared(ownPrivate, serverPublic)) {
      return null;
    }
    return join(ephemeralPublic, encryptedStatic, encrypt(payload));
  }

  /** Reads message 1. Returns its payload; null if it is not authentic. */
  public byte[] readMessage1(byte[] message) {
    otherEphemeral = Arrays.copyOf(message, 32);
    mixHash(otherEphemeral);
    mixKey(otherEphemeral);
    if (!mixShared(ownPrivate, otherEphemeral)) {
      return null;
    }
    clientPublic = decrypt(Arrays.copyOfRange(message, 32, 80));
    if (clientPublic == null || !mixShared(ownPrivate, clientPublic)) {
      return null;
    }
    return decrypt(Arrays.copyOfRange(message, 80, MESSAGE_1_SIZE));
  }

  /** The client's long-lived key, from message 1. */
  public byte[] clientPublic() {
    return clientPublic;
  }

  /** Writes message 2. Returns null if a key of the client is of small order. */
  public byte[] writeMessage2(byte[] newEphemeral, byte[] payload) {
    byte[] ephemeralPublic = Crypto.publicOf(newEphemeral);
    mixHash(ephemeralPublic);
    mixKey(ephemeralPublic);
    if (!mixShared(newEphemeral, otherEphemeral) || !mixShared(newEphemeral, clientPublic)) {
      return null;
    }
    mixKeyAndHash(presharedKey);
    return join(ephemeralPublic, encrypt(payload));
  }

  /**
   * Reads message 2. Returns its payload; null if it is not authentic: then the right one may still
   * come (sec-3-4).
   */
  public byte[] readMessage2(byte[] message) {
    byte[] hashBefore = hash;
    byte[] chainingBefore = chaining;
    AeadKey keyBefore = key;
    long counterBefore = counter;
    byte[] ephemeralPublic = Arrays.copyOf(message, 32);
    mixHash(ephemeralPublic);
    mixKey(ephemeralPublic);
    byte[] payload = null;
    if (mixShared(ephemeral, ephemeralPublic) && mixShared(ownPrivate, ephemeralPublic)) {
      mixKeyAndHash(presharedKey);
      payload = decrypt(Arrays.copyOfRange(message, 32, MESSAGE_2_SIZE));
    }
    if (payload == null) {
      hash = hashBefore;
      chaining = chainingBefore;
      key = keyBefore;
      counter = counterBefore;
    }
    return payload;
  }

  /** The session's keys, after message 2. */
  public Keys keys() {
    byte[][] derived = derive(NOTHING, 2);
    return new Keys(suite, derived[0], derived[1], hash);
  }

  private void mixHash(byte[] data) {
    hash = Crypto.sha256(hash, data);
  }

  private byte[][] derive(byte[] data, int count) {
    byte[] secret = Crypto.hmac(chaining, data);
    byte[][] derived = new byte[count][];
    byte[] last = NOTHING;
    for (int i = 0; i < count; ++i) {
      last = Crypto.hmac(secret, last, new byte[] {(byte) (i + 1)});
      derived[i] = last;
    }
    return derived;
  }

  private void mixKey(byte[] data) {
    byte[][] derived = derive(data, 2);
    chaining = derived[0];
    key = new AeadKey(suite, derived[1]);
    counter = 0;
  }

  private void mixKeyAndHash(byte[] data) {
    byte[][] derived = derive(data, 3);
    chaining = derived[0];
    mixHash(derived[1]);
    key = new AeadKey(suite, derived[2]);
    counter = 0;
  }

  private boolean mixShared(byte[] privateKey, byte[] publicKey) {
    byte[] shared = Crypto.x25519(privateKey, publicKey);
    if (shared == null) {
      return false;
    }
    mixKey(shared);
    return true;
  }

  private byte[] encrypt(byte[] text) {
    byte[] sealed = key.seal(counter++, hash, text);
    mixHash(sealed);
    return sealed;
  }

  private byte[] decrypt(byte[] sealed) {
    byte[] text = key.open(counter++, hash, hash.length, sealed);
    if (text != null) {
      mixHash(sealed);
    }
    return text;
  }

  private static byte[] join(byte[]... parts) {
    int size = 0;
    for (byte[] part : parts) {
      size += part.length;
    }
    byte[] all = new byte[size];
    int at = 0;
    for (byte[] part : parts) {
      System.arraycopy(part, 0, all, at, part.length);
      at += part.length;
    }
    return all;
  }
}

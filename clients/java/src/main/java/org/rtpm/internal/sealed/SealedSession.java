package org.rtpm.internal.sealed;

import java.util.Arrays;
import org.rtpm.internal.wire.Bytes;
import org.rtpm.internal.wire.DropReason;
import org.rtpm.internal.wire.Limits;

/** Seals and opens the frames of a session (sec-4, sec-5). One thread at a time. */
public final class SealedSession {
  private static final int GENERATION_BITS = 22;
  private static final long COUNTER_END = 1L << 48;
  private static final long FORGED_MAX = 1L << 36;

  private final boolean isExact;
  private final AeadKey[] sendKeys = new AeadKey[2];
  private final AeadKey[] receiveKeys = new AeadKey[3];
  private final ReplayWindow window = new ReplayWindow();
  private long sendCounter;
  private long receiveGeneration;
  private long forgedCount;
  private DropReason fault;

  /**
   * Begins a session.
   *
   * @param isExact on a stream, where each counter is the one after the last (sec-5-7)
   */
  public SealedSession(Suite suite, byte[] sendKey, byte[] receiveKey, boolean isExact) {
    this.isExact = isExact;
    sendKeys[0] = new AeadKey(suite, sendKey);
    sendKeys[1] = sendKeys[0].next();
    receiveKeys[0] = new AeadKey(suite, receiveKey);
    receiveKeys[1] = receiveKeys[0].next();
  }

  /** sec-5-6: whether no frame can be sent or received any more. */
  public boolean hasEnded() {
    return sendCounter >= COUNTER_END || forgedCount >= FORGED_MAX;
  }

  /** Whether three quarters of what the keys may be used for are used up. */
  public boolean isWorn() {
    return sendCounter >= COUNTER_END / 4 * 3 || forgedCount >= FORGED_MAX / 4 * 3;
  }

  /** Seals a frame; null if the session has ended. */
  public byte[] seal(byte[] frame) {
    if (hasEnded()) {
      return null;
    }
    long counter = sendCounter++;
    AeadKey key = sendKeys[(int) (generation(counter) % 2)];
    if (generation(sendCounter) != generation(counter)) {
      // The current key becomes the previous one; its place gets the one after the next.
      int next = (int) (generation(sendCounter) % 2);
      sendKeys[1 - next] = sendKeys[next].next();
    }
    byte[] header = Arrays.copyOf(frame, Limits.HEADER_SIZE);
    Sealing.mark(header);
    int size = frame.length - Limits.HEADER_SIZE;
    byte[] sealed = key.seal(counter, header, Limits.HEADER_SIZE, frame, Limits.HEADER_SIZE, size);
    byte[] out = Arrays.copyOf(header, frame.length + Sealing.TRAILER_SIZE);
    System.arraycopy(sealed, 0, out, Limits.HEADER_SIZE, size);
    Bytes.put64(out, frame.length, counter);
    System.arraycopy(sealed, size, out, frame.length + 8, Crypto.TAG_SIZE);
    return out;
  }

  /**
   * Opens a sealed frame whose header was checked. Returns the ordinary frame; null if it is to be
   * dropped, see {@link #fault}.
   */
  public byte[] open(byte[] frame) {
    int end = frame.length - Sealing.TRAILER_SIZE;
    long counter = Bytes.i64(frame, end);
    fault = judge(counter);
    if (fault != null) {
      return null;
    }
    byte[] sealed = new byte[end - Limits.HEADER_SIZE + Crypto.TAG_SIZE];
    System.arraycopy(frame, Limits.HEADER_SIZE, sealed, 0, end - Limits.HEADER_SIZE);
    System.arraycopy(frame, end + 8, sealed, end - Limits.HEADER_SIZE, Crypto.TAG_SIZE);
    byte[] payload =
        receiveKey(generation(counter)).open(counter, frame, Limits.HEADER_SIZE, sealed);
    if (payload == null) {
      ++forgedCount;
      fault = DropReason.BAD_SEAL;
      return null;
    }
    accept(counter);
    byte[] plain = Arrays.copyOf(frame, end);
    Sealing.unmark(plain);
    System.arraycopy(payload, 0, plain, Limits.HEADER_SIZE, payload.length);
    return plain;
  }

  /** Why {@link #open} dropped the last frame. */
  public DropReason fault() {
    return fault;
  }

  // sec-5-4 to sec-5-7: what these checks refuse costs no cryptography.
  private DropReason judge(long counter) {
    if (hasEnded() || counter < 0 || counter >= COUNTER_END) {
      return DropReason.BAD_SEAL;
    }
    if ((isExact && counter != window.next()) || !window.isNew(counter)) {
      return DropReason.REPLAYED;
    }
    long generation = generation(counter);
    return generation + 1 < receiveGeneration || generation > receiveGeneration + 1
        ? DropReason.BAD_SEAL
        : null;
  }

  // sec-5-3: only here, after its tag was found right, a frame changes the session.
  private void accept(long counter) {
    window.add(counter);
    long generation = generation(counter);
    if (generation > receiveGeneration) {
      receiveGeneration = generation;
      receiveKeys[(int) ((generation + 1) % 3)] = receiveKey(generation).next();
    }
  }

  /** The key of the generation after that of {@code key} (sec-5-5). */
  public static byte[] nextKey(Suite suite, byte[] key) {
    return new AeadKey(suite, key).nextBytes();
  }

  private AeadKey receiveKey(long generation) {
    return receiveKeys[(int) (generation % 3)];
  }

  private static long generation(long counter) {
    return counter >>> GENERATION_BITS;
  }
}

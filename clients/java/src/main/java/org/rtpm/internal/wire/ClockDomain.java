package org.rtpm.internal.wire;

import java.io.IOException;
import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.Path;

/** Tells whether two programs read one monotonic clock (hp-4.1-7). */
public final class ClockDomain {
  private static final long FNV_BASIS = 0xcbf29ce484222325L;
  private static final long FNV_PRIME = 0x100000001b3L;

  private ClockDomain() {}

  /** The FNV-1a hash of 64 bits of what both files hold. */
  public static long of(String bootId, String timeNamespace) {
    long hash = FNV_BASIS;
    for (byte b : (bootId + timeNamespace).getBytes(StandardCharsets.UTF_8)) {
      hash = (hash ^ (b & 0xff)) * FNV_PRIME;
    }
    return hash;
  }

  /**
   * This program's clock domain; 0 if it is not known.
   *
   * <p>On Linux {@link System#nanoTime} reads CLOCK_MONOTONIC.
   */
  public static long ofThisProgram() {
    if (!System.getProperty("os.name", "").equals("Linux")) {
      return 0;
    }
    try {
      String bootId = Files.readString(Path.of("/proc/sys/kernel/random/boot_id"));
      Path link = Path.of("/proc/self/ns/time");
      String namespace = Files.isSymbolicLink(link) ? Files.readSymbolicLink(link).toString() : "";
      return of(bootId, namespace);
    } catch (IOException | RuntimeException e) {
      return 0;
    }
  }
}

package org.rtpm.internal.serve;

import java.io.IOException;
import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.Path;
import java.nio.file.attribute.BasicFileAttributes;
import java.nio.file.attribute.PosixFilePermission;
import java.util.List;
import java.util.Set;
import org.rtpm.internal.wire.Limits;
import org.rtpm.internal.wire.Peer;

/** The grants of a file, which is read again when it changed. Threads: any. */
public final class GrantFile {
  /** A changed file is in force within this time. */
  static final long LOOK_INTERVAL = Limits.SECOND / 2;

  private static final long SIZE_MAX = 16 * 1024 * 1024;

  private final Path file;
  private List<Object> stamp;
  private long lookedAt = System.nanoTime();
  private volatile Grants grants;

  /**
   * Reads a file.
   *
   * @throws IOException if it can't be read, others can write it, or it grants nothing
   */
  public GrantFile(Path file) throws IOException {
    this.file = file;
    stamp = stampOf(file);
    grants = read();
    if (grants.isEmpty()) {
      String fault = grants.faults().isEmpty() ? "it is empty" : "line " + grants.faults().get(0);
      throw new IOException(
          "no line of " + file + " grants anything: " + fault
              + ". Add one with `rtpm key authorize`");
    }
  }

  private static List<Object> stampOf(Path file) throws IOException {
    BasicFileAttributes attributes = Files.readAttributes(file, BasicFileAttributes.class);
    return List.of(
        attributes.lastModifiedTime(), attributes.size(), String.valueOf(attributes.fileKey()));
  }

  private Grants read() throws IOException {
    if (Files.getFileStore(file).supportsFileAttributeView("posix")) {
      Set<PosixFilePermission> allowed = Files.getPosixFilePermissions(file);
      if (allowed.contains(PosixFilePermission.GROUP_WRITE)
          || allowed.contains(PosixFilePermission.OTHERS_WRITE)) {
        throw new IOException(
            file + ": others can write it, and so grant themselves anything: chmod go-w " + file);
      }
    }
    if (Files.size(file) > SIZE_MAX) {
      throw new IOException(file + " is larger than " + SIZE_MAX + " bytes");
    }
    Grants read = new Grants(new String(Files.readAllBytes(file), StandardCharsets.UTF_8));
    for (String fault : read.faults()) {
      warn(file + ":" + fault + "; this line allows nothing");
    }
    return read;
  }

  private static void warn(String text) {
    System.getLogger("rtpm").log(System.Logger.Level.WARNING, text);
  }

  /** The grants in force, which are another object when they have changed. */
  synchronized Grants look(long now) {
    if (now - lookedAt < LOOK_INTERVAL) {
      return grants;
    }
    lookedAt = now;
    try {
      List<Object> newStamp = stampOf(file);
      if (!newStamp.equals(stamp)) {
        stamp = newStamp;
        grants = read();
      }
    } catch (IOException e) {
      warn(e + "; the former grants stay in force");
    }
    return grants;
  }

  /** Whether a client has any grant; the key is null if its session is not sealed. */
  public boolean knows(byte[] key) {
    return grants.knows(key);
  }

  Grants.Permission permission(byte[] key, Peer peer, String path) {
    // A client with any grant may ask the catalog, which shows only what that client may see.
    return grants.permission(key, peer, path.equals(Catalog.PATH) ? null : path);
  }
}

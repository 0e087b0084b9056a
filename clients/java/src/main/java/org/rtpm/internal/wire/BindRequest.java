package org.rtpm.internal.wire;

import java.nio.charset.StandardCharsets;

/** The request of the session's method 1, bind (hp-6.1). */
public record BindRequest(long fingerprint, String path, String interfaceName) {

  /** Reads a payload; null if it is malformed. */
  public static BindRequest read(byte[] payload) {
    if (payload.length < 12) {
      return null;
    }
    int pathSize = Bytes.u16(payload, 8);
    int nameAt = 10 + pathSize + 2;
    if (pathSize > Limits.PATH_SIZE_MAX || nameAt > payload.length) {
      return null;
    }
    int nameSize = Bytes.u16(payload, nameAt - 2);
    if (nameAt + nameSize != payload.length) {
      return null;
    }
    return new BindRequest(
        Bytes.i64(payload, 0),
        new String(payload, 10, pathSize, StandardCharsets.UTF_8),
        new String(payload, nameAt, nameSize, StandardCharsets.UTF_8));
  }

  /**
   * Writes the payload.
   *
   * @throws IllegalArgumentException if the path is longer than 200 bytes, or the name than a frame
   *     holds
   */
  public byte[] payload() {
    byte[] pathBytes = path.getBytes(StandardCharsets.UTF_8);
    byte[] nameBytes = interfaceName.getBytes(StandardCharsets.UTF_8);
    if (pathBytes.length > Limits.PATH_SIZE_MAX || nameBytes.length > 1000) {
      throw new IllegalArgumentException("a path has at most 200 bytes, an interface's name 1000");
    }
    byte[] to = new byte[12 + pathBytes.length + nameBytes.length];
    Bytes.put64(to, 0, fingerprint);
    Bytes.put16(to, 8, pathBytes.length);
    System.arraycopy(pathBytes, 0, to, 10, pathBytes.length);
    int nameAt = 12 + pathBytes.length;
    Bytes.put16(to, nameAt - 2, nameBytes.length);
    System.arraycopy(nameBytes, 0, to, nameAt, nameBytes.length);
    return to;
  }
}

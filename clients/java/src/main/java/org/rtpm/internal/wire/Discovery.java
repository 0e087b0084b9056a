package org.rtpm.internal.wire;

import java.util.ArrayList;
import java.util.List;

/**
 * A datagram of discovery on the LAN (hp-10.1).
 *
 * @param isAnswer else it is a query
 * @param number drawn at random for the query; an answer repeats it
 */
public record Discovery(boolean isAnswer, int domain, long number, List<Service> services) {
  public static final int SIZE = 256;
  public static final int PORT = 7423;
  public static final int SERVICE_COUNT_MAX = 30;
  private static final int MAGIC = 0x44505452;
  private static final int SERVICES_AT = 16;
  private static final int SERVICE_SIZE = 8;

  /**
   * A name service.
   *
   * @param isRegistry else a server that serves its own names
   * @param processId 0 if it is not told
   */
  public record Service(int port, boolean isRegistry, int processId) {}

  /** Reads a datagram; null if it is to be dropped (hp-10.1-2). */
  public static Discovery read(byte[] datagram) {
    if (datagram.length != SIZE
        || Bytes.i32(datagram, 0) != MAGIC
        || datagram[4] != 1
        || datagram[5] < 1
        || datagram[5] > 2) {
      return null;
    }
    boolean isAnswer = datagram[5] == 2;
    int count = Bytes.u8(datagram, 7);
    int end = SERVICES_AT + count * SERVICE_SIZE;
    if (count > (isAnswer ? SERVICE_COUNT_MAX : 0) || !Bytes.areZero(datagram, end, SIZE)) {
      return null;
    }
    List<Service> services = new ArrayList<>();
    for (int at = SERVICES_AT; at < end; at += SERVICE_SIZE) {
      int port = Bytes.u16(datagram, at);
      if (port == 0 || datagram[at + 2] < 1 || datagram[at + 2] > 2 || datagram[at + 3] != 0) {
        return null;
      }
      services.add(new Service(port, datagram[at + 2] == 1, Bytes.i32(datagram, at + 4)));
    }
    return new Discovery(isAnswer, Bytes.u8(datagram, 6), Bytes.i64(datagram, 8), services);
  }

  public byte[] datagram() {
    byte[] to = new byte[SIZE];
    Bytes.put32(to, 0, MAGIC);
    to[4] = 1;
    to[5] = (byte) (isAnswer ? 2 : 1);
    to[6] = (byte) domain;
    to[7] = (byte) services.size();
    Bytes.put64(to, 8, number);
    int at = SERVICES_AT;
    for (Service service : services) {
      Bytes.put16(to, at, service.port);
      to[at + 2] = (byte) (service.isRegistry ? 1 : 2);
      Bytes.put32(to, at + 4, service.processId);
      at += SERVICE_SIZE;
    }
    return to;
  }
}

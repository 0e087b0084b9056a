package org.rtpm;

import java.nio.file.Path;
import java.util.List;
import java.util.Objects;
import java.util.Set;

/**
 * How a server serves.
 *
 * @param hosts numeric addresses or names of this host; empty: all of its addresses
 * @param port under which UDP and TCP are served; 0: any that is free
 * @param lanes the bands of priorities; disjoint, and together 0 to 32767
 * @param ceiling calls above this priority are refused
 * @param sessionCountMax sessions of a lane, over UDP and over TCP each; a host gets three quarters
 * @param messageSizeMax the largest request or reply, 1 KiB to 16 MiB
 * @param largeCountMax messages larger than a frame that a lane holds at a time, over UDP and over
 *     TCP each: bounds its memory together with messageSizeMax
 * @param streamCountMax streams of a lane at a time, over UDP and over TCP each
 * @param queueSizeMax calls that may wait in a lane; more are refused with overload
 * @param key this server's key: sessions are sealed; null: they are not
 * @param clients whom a sealed server admits to everything
 * @param admitsUnsealed whether a sealed server opens unsealed sessions, too; with a file of
 *     grants, its lines for {@code anonymous} say that
 * @param authorized the file of grants that {@code rtpm key authorize} writes: what other clients
 *     of a sealed server may do; read again within a second of a change. Null: none
 * @param presharedKey 32 bytes that both sides are configured with; null: none
 */
public record ServerOptions(
    List<String> hosts,
    int port,
    List<LaneOptions> lanes,
    int ceiling,
    int sessionCountMax,
    int messageSizeMax,
    int largeCountMax,
    int streamCountMax,
    int queueSizeMax,
    PrivateKey key,
    Set<PublicKey> clients,
    boolean admitsUnsealed,
    Path authorized,
    byte[] presharedKey) {
  /**
   * A lane.
   *
   * @param low the lowest priority of its band
   * @param high the highest one
   * @param threadCount how many calls run at a time
   */
  public record LaneOptions(int low, int high, int threadCount) {}

  /** On this host only, at any port, in one lane of four threads. */
  public static final ServerOptions DEFAULT =
      new ServerOptions(
          List.of("127.0.0.1"),
          0,
          List.of(new LaneOptions(0, 32767, 4)),
          32767,
          256,
          4 * 1024 * 1024,
          32,
          16,
          256,
          null,
          Set.of(),
          false,
          null,
          null);

  /** Checks and copies the components. */
  public ServerOptions {
    hosts = List.copyOf(hosts);
    lanes = List.copyOf(lanes);
    clients = Set.copyOf(clients);
    presharedKey = presharedKey == null ? null : presharedKey.clone();
    Objects.checkIndex(port, 65536);
    check(ceiling >= 0 && ceiling <= 32767, "the ceiling is not 0 to 32767");
    check(sessionCountMax >= 1 && sessionCountMax <= 65535, "sessions are not 1 to 65535");
    check(
        messageSizeMax >= 1024 && messageSizeMax <= 16 * 1024 * 1024,
        "the largest message is not 1 KiB to 16 MiB");
    check(
        largeCountMax >= 0 && streamCountMax >= 0 && queueSizeMax >= 1,
        "a limit is negative, or no call may wait");
    check(presharedKey == null || presharedKey.length == 32, "a pre-shared key has 32 bytes");
    check(
        key != null || (clients.isEmpty() && authorized == null),
        "a server that admits keys needs one of its own");
    checkBands(lanes);
  }

  // hp-11-1
  private static void checkBands(List<LaneOptions> lanes) {
    boolean[] isServed = new boolean[32768];
    for (LaneOptions lane : lanes) {
      check(
          lane.low >= 0 && lane.low <= lane.high && lane.high <= 32767 && lane.threadCount >= 1,
          "a lane has a band within 0 to 32767, and at least one thread");
      for (int priority = lane.low; priority <= lane.high; ++priority) {
        check(!isServed[priority], "two lanes serve priority " + priority);
        isServed[priority] = true;
      }
    }
    for (int priority = 0; priority < isServed.length; ++priority) {
      check(isServed[priority], "no lane serves priority " + priority);
    }
  }

  private static void check(boolean isGood, String fault) {
    if (!isGood) {
      throw new IllegalArgumentException(fault);
    }
  }

  /** These options at other hosts. */
  public ServerOptions withHosts(String... newHosts) {
    return new ServerOptions(
        List.of(newHosts), port, lanes, ceiling, sessionCountMax, messageSizeMax, largeCountMax,
        streamCountMax, queueSizeMax, key, clients, admitsUnsealed, authorized,
        presharedKey);
  }

  /** These options at another port. */
  public ServerOptions withPort(int newPort) {
    return new ServerOptions(
        hosts, newPort, lanes, ceiling, sessionCountMax, messageSizeMax, largeCountMax,
        streamCountMax, queueSizeMax, key, clients, admitsUnsealed, authorized,
        presharedKey);
  }

  /** These options with other lanes. */
  public ServerOptions withLanes(LaneOptions... newLanes) {
    return new ServerOptions(
        hosts, port, List.of(newLanes), ceiling, sessionCountMax, messageSizeMax, largeCountMax,
        streamCountMax, queueSizeMax, key, clients, admitsUnsealed, authorized,
        presharedKey);
  }

  /** These options with another ceiling. */
  public ServerOptions withCeiling(int newCeiling) {
    return new ServerOptions(
        hosts, port, lanes, newCeiling, sessionCountMax, messageSizeMax, largeCountMax,
        streamCountMax, queueSizeMax, key, clients, admitsUnsealed, authorized,
        presharedKey);
  }

  /** These options with other limits. */
  public ServerOptions withLimits(
      int newSessionCountMax, int newMessageSizeMax, int newLargeCountMax) {
    return new ServerOptions(
        hosts, port, lanes, ceiling, newSessionCountMax, newMessageSizeMax, newLargeCountMax,
        streamCountMax, queueSizeMax, key, clients, admitsUnsealed, authorized,
        presharedKey);
  }

  /** These options with sealed sessions for these clients. */
  public ServerOptions withKey(PrivateKey own, Set<PublicKey> admitted, boolean alsoUnsealed) {
    return new ServerOptions(
        hosts, port, lanes, ceiling, sessionCountMax, messageSizeMax, largeCountMax,
        streamCountMax, queueSizeMax, own, admitted, alsoUnsealed, authorized,
        presharedKey);
  }

  /**
   * These options with sealed sessions for the clients that a file grants something.
   *
   * @param file as {@code rtpm key authorize --file} writes it; only its owner may write it
   */
  public ServerOptions withAuthorized(PrivateKey own, Path file) {
    return new ServerOptions(
        hosts, port, lanes, ceiling, sessionCountMax, messageSizeMax, largeCountMax,
        streamCountMax, queueSizeMax, own, clients, admitsUnsealed, file, presharedKey);
  }
}

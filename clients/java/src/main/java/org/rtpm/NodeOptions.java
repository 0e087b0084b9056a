package org.rtpm;

import java.net.InetAddress;
import java.net.UnknownHostException;
import java.time.Duration;
import java.util.HashMap;
import java.util.List;
import java.util.Locale;
import java.util.Map;
import java.util.Objects;

/**
 * How a node calls.
 *
 * @param transport how frames go
 * @param deadline of calls whose options and method state none
 * @param priority at which objects are bound, 0 to 32767; calls that state none have the object's
 * @param messageSizeMax the largest reply or item, 1 KiB to 16 MiB
 * @param streamWindow how many items of a stream are taken at a time, 1 to 32
 * @param isSpinning the node's thread polls instead of sleeping: takes a CPU, saves microseconds
 * @param key this program's key; null: sessions are not sealed
 * @param serverKeys of servers, by {@code host:port}, {@code [IPv6]:port} or {@code host}; where
 *     one is known, sessions are sealed, and no others are opened
 * @param presharedKey 32 bytes that both sides are configured with; null: none
 * @param registries where names are looked up: {@code host}, {@code host:port}, {@code
 *     [IPv6]:port} or {@code rtpm://host:port/rtpm/names}, by default at port 7420; each is asked
 *     until one answers. Empty: those of the environment variable RTPM_REGISTRY, else this host
 */
public record NodeOptions(
    Transport transport,
    Duration deadline,
    int priority,
    int messageSizeMax,
    int streamWindow,
    boolean isSpinning,
    PrivateKey key,
    Map<String, PublicKey> serverKeys,
    byte[] presharedKey,
    List<String> registries) {
  /** UDP, a second, the usual registry. */
  public static final NodeOptions DEFAULT =
      new NodeOptions(
          Transport.UDP,
          Duration.ofSeconds(1),
          16_000,
          4 * 1024 * 1024,
          16,
          false,
          null,
          Map.of(),
          null,
          List.of());

  /** Checks and copies the components. */
  public NodeOptions {
    Objects.requireNonNull(transport);
    serverKeys = Map.copyOf(serverKeys);
    registries = List.copyOf(registries);
    presharedKey = presharedKey == null ? null : presharedKey.clone();
    check(deadline.compareTo(Duration.ZERO) > 0, "the deadline is not positive");
    check(priority >= 0 && priority <= 32767, "the priority is not 0 to 32767");
    check(
        messageSizeMax >= 1024 && messageSizeMax <= 16 * 1024 * 1024,
        "the largest message is not 1 KiB to 16 MiB");
    check(streamWindow >= 1 && streamWindow <= 32, "the window is not 1 to 32");
    check(presharedKey == null || presharedKey.length == 32, "a pre-shared key has 32 bytes");
    check(serverKeys.isEmpty() || key != null, "sealed sessions need a key of this program");
  }

  private static void check(boolean isGood, String fault) {
    if (!isGood) {
      throw new IllegalArgumentException(fault);
    }
  }

  /** These options with another transport. */
  public NodeOptions withTransport(Transport newTransport) {
    return new NodeOptions(
        newTransport, deadline, priority, messageSizeMax, streamWindow, isSpinning, key, serverKeys,
        presharedKey, registries);
  }

  /** These options with another default deadline. */
  public NodeOptions withDeadline(Duration newDeadline) {
    return new NodeOptions(
        transport, newDeadline, priority, messageSizeMax, streamWindow, isSpinning, key, serverKeys,
        presharedKey, registries);
  }

  /** These options with another priority. */
  public NodeOptions withPriority(int newPriority) {
    return new NodeOptions(
        transport, deadline, newPriority, messageSizeMax, streamWindow, isSpinning, key, serverKeys,
        presharedKey, registries);
  }

  /** These options with a thread that polls, or one that sleeps. */
  public NodeOptions withSpinning(boolean spins) {
    return new NodeOptions(
        transport, deadline, priority, messageSizeMax, streamWindow, spins, key, serverKeys,
        presharedKey, registries);
  }

  /** These options with other registries. */
  public NodeOptions withRegistries(String... newRegistries) {
    return new NodeOptions(
        transport, deadline, priority, messageSizeMax, streamWindow, isSpinning, key, serverKeys,
        presharedKey, List.of(newRegistries));
  }

  /** These options with this program's key, and one more server that is called sealed. */
  public NodeOptions withServerKey(PrivateKey own, String server, PublicKey serverKey) {
    Map<String, PublicKey> keys = new HashMap<>(serverKeys);
    keys.put(server, serverKey);
    return new NodeOptions(
        transport, deadline, priority, messageSizeMax, streamWindow, isSpinning, own, keys,
        presharedKey, registries);
  }

  /** The key of the server at one of the address's hosts; null if none is known. */
  PublicKey serverKey(Address address) {
    for (String host : address.hosts()) {
      String server = canonicalHost(host);
      PublicKey ofHost = null;
      for (Map.Entry<String, PublicKey> each : serverKeys.entrySet()) {
        String known = canonical(each.getKey());
        if (known.equals(server + " " + address.port())) {
          return each.getValue();
        }
        ofHost = known.equals(server) ? each.getValue() : ofHost;
      }
      if (ofHost != null) {
        return ofHost;
      }
    }
    return null;
  }

  // A host, and a port behind it if there is one: an IPv6 address may be written in several ways.
  private static String canonical(String server) {
    int bracket = server.startsWith("[") ? server.indexOf(']') : -1;
    int colon = server.lastIndexOf(':');
    boolean hasPort = bracket > 0 ? colon > bracket : colon >= 0 && colon == server.indexOf(':');
    String host = hasPort ? server.substring(0, colon) : server;
    host = bracket > 0 ? server.substring(1, bracket) : host;
    return canonicalHost(host) + (hasPort ? " " + server.substring(colon + 1) : "");
  }

  private static String canonicalHost(String host) {
    if (!host.contains(":")) {
      return host.toLowerCase(Locale.ROOT);
    }
    try {
      // With a colon it is no name, which would be looked up.
      return InetAddress.getByName(host).getHostAddress();
    } catch (UnknownHostException e) {
      return host;
    }
  }
}

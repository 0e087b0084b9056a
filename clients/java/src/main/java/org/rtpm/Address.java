package org.rtpm;

import java.util.ArrayList;
import java.util.List;
import java.util.regex.Pattern;

/**
 * The address of an object: {@code rtpm://host:port/path}, or {@code rtpm://host,host:port/path}
 * where its server has several (spec/hprotocol.md, section 10).
 *
 * @param hosts 1 to 8 numeric addresses or names, IPv6 ones without brackets
 * @param port 1 to 65535
 * @param path 1 to 200 bytes: components of letters, digits, {@code . _ -}, with single slashes
 */
public record Address(List<String> hosts, int port, String path) {
  private static final String SCHEME = "rtpm://";
  private static final int HOST_COUNT_MAX = 8;
  private static final Pattern NAME = Pattern.compile("[A-Za-z0-9._-]+");
  private static final Pattern ZONE = Pattern.compile("[A-Za-z0-9._-]{1,15}");
  private static final Pattern PORT = Pattern.compile("[0-9]{1,10}");
  private static final Pattern PATH = Pattern.compile("[A-Za-z0-9._-]+(/[A-Za-z0-9._-]+)*");
  private static final Pattern GROUP = Pattern.compile("[0-9A-Fa-f]{1,4}");
  private static final Pattern IPV4 =
      Pattern.compile(
          "(?:(?:25[0-5]|2[0-4][0-9]|1[0-9][0-9]|[1-9]?[0-9])(?:\\.(?!$)|$)){4}");

  /** Copies the hosts. */
  public Address {
    hosts = List.copyOf(hosts);
  }

  /**
   * Reads an address.
   *
   * @throws IllegalArgumentException if the text is malformed; the message says what an address
   *     looks like
   */
  public static Address parse(String text) {
    Address address = read(text);
    if (address == null) {
      throw new IllegalArgumentException(
          "'" + Printable.of(text) + "' is no address such as rtpm://host:7421/lab/arm0");
    }
    return address;
  }

  /** Whether the text claims to be an address, well-formed or not, and no name. */
  public static boolean isAddress(String text) {
    return text.contains("://");
  }

  /** Whether the text is the path of an object. */
  public static boolean isPath(String text) {
    return text.length() <= 200 && PATH.matcher(text).matches();
  }

  /** Reads an address; null if it is malformed. */
  static Address read(String text) {
    if (!text.startsWith(SCHEME)) {
      return null;
    }
    int slash = text.indexOf('/', SCHEME.length());
    if (slash < 0) {
      return null;
    }
    String authority = text.substring(SCHEME.length(), slash);
    String path = text.substring(slash + 1);
    int colon = authority.lastIndexOf(':');
    if (colon < 0 || !isPath(path)) {
      return null;
    }
    String port = authority.substring(colon + 1);
    if (!PORT.matcher(port).matches()
        || Long.parseLong(port) < 1
        || Long.parseLong(port) > 65535) {
      return null;
    }
    List<String> hosts = new ArrayList<>();
    for (String part : authority.substring(0, colon).split(",", -1)) {
      String host = readHost(part);
      if (host == null || hosts.size() == HOST_COUNT_MAX) {
        return null;
      }
      hosts.add(host);
    }
    return new Address(hosts, Integer.parseInt(port), path);
  }

  private static String readHost(String part) {
    if (!part.startsWith("[")) {
      return NAME.matcher(part).matches() ? part : null;
    }
    if (!part.endsWith("]")) {
      return null;
    }
    String inner = part.substring(1, part.length() - 1);
    int percent = inner.indexOf('%');
    String host = percent < 0 ? inner : inner.substring(0, percent);
    if (!isIpv6(host)) {
      return null;
    }
    if (percent < 0) {
      return host;
    }
    // RFC 6874
    String zone = inner.substring(percent);
    return zone.startsWith("%25") && ZONE.matcher(zone.substring(3)).matches()
        ? host + "%" + zone.substring(3)
        : null;
  }

  // RFC 4291, 2.2
  private static boolean isIpv6(String text) {
    int gap = text.indexOf("::");
    if (gap < 0) {
      return groupCount(text, true) == 8;
    }
    int before = groupCount(text.substring(0, gap), false);
    int after = groupCount(text.substring(gap + 2), true);
    return before >= 0 && after >= 0 && before + after < 8;
  }

  // The number of groups of 16 bits; -1 if one is malformed.
  private static int groupCount(String text, boolean mayEndInIpv4) {
    if (text.isEmpty()) {
      return 0;
    }
    String[] groups = text.split(":", -1);
    int count = groups.length;
    for (int i = 0; i < groups.length; ++i) {
      boolean isLast = i == groups.length - 1;
      if (isLast && mayEndInIpv4 && IPV4.matcher(groups[i]).matches()) {
        ++count;
      } else if (!GROUP.matcher(groups[i]).matches()) {
        return -1;
      }
    }
    return count;
  }

  /** The hosts and the port, such as {@code 127.0.0.1:7421} or {@code [::1],10.0.0.7:7421}. */
  public String authority() {
    List<String> parts = new ArrayList<>();
    for (String host : hosts) {
      parts.add(host.contains(":") ? "[" + host.replace("%", "%25") + "]" : host);
    }
    return String.join(",", parts) + ":" + port;
  }

  /** The whole address. */
  @Override
  public String toString() {
    return SCHEME + authority() + "/" + path;
  }
}

package org.rtpm.internal.serve;

import java.net.InetAddress;
import java.net.UnknownHostException;
import java.nio.ByteBuffer;
import java.nio.charset.StandardCharsets;
import java.util.ArrayList;
import java.util.Arrays;
import java.util.Base64;
import java.util.HashMap;
import java.util.HashSet;
import java.util.List;
import java.util.Locale;
import java.util.Map;
import java.util.Set;
import java.util.regex.Pattern;
import org.rtpm.internal.wire.Bytes;
import org.rtpm.internal.wire.Peer;
import org.rtpm.values.Role;

/**
 * What clients may do: the lines of a file {@code authorized} (docs/security.md). Lines add up, and
 * what no line allows is refused. Immutable.
 */
final class Grants {
  /** What a client may do with an object. */
  record Permission(Role role, int ceiling) {
    static final Permission ALL = new Permission(Role.ADMINISTER, 32767);
    /** The role is null: for this client, the object is not there. */
    static final Permission NONE = new Permission(null, 0);

    boolean allows(Role needed) {
      return role != null && role.compareTo(needed) >= 0;
    }
  }

  private record Grant(Role role, List<String> objects, int ceiling, List<Range> from) {}

  /** Addresses with a common beginning. IPv4 ones are at the end of ::ffff:0:0/96. */
  private record Range(byte[] prefix, int bitCount) {
    boolean contains(byte[] address) {
      for (int bit = 0; bit < bitCount; ++bit) {
        if (isSet(prefix, bit) != isSet(address, bit)) {
          return false;
        }
      }
      return true;
    }
  }

  /** A line that allows nothing. */
  private static final class Fault extends Exception {
    private static final long serialVersionUID = 1L;

    Fault(String why) {
      super(why, null, false, false);
    }
  }

  private static final int GRANT_COUNT_MAX = 4096;
  private static final int LINE_SIZE_MAX = 4096;
  private static final int ITEM_COUNT_MAX = 32;
  private static final int FAULT_COUNT_MAX = 32;
  private static final int KEY_SIZE = 32;
  private static final int ADDRESS_BITS = 128;
  private static final int MAPPED_BITS = 96;
  private static final String ANY = "**";
  private static final Pattern COMPONENT = Pattern.compile("\\*|\\*\\*|[A-Za-z0-9._-]+");
  private static final Pattern IPV4 =
      Pattern.compile("(25[0-5]|2[0-4]\\d|1?\\d?\\d)(\\.(25[0-5]|2[0-4]\\d|1?\\d?\\d)){3}");
  private static final Pattern IPV6 = Pattern.compile("[0-9a-fA-F:.]*:[0-9a-fA-F:.]*");
  private static final Pattern NUMBER = Pattern.compile("\\d{1,9}");

  private final Map<ByteBuffer, List<Grant>> byKey = new HashMap<>();
  private final List<Grant> anonymous = new ArrayList<>();
  private final List<String> faults = new ArrayList<>();
  private int count;

  /**
   * Reads the lines.
   *
   * @param text what is not well-formed in it is in {@link #faults}, and allows nothing
   */
  Grants(String text) {
    String[] lines = text.split("\n", -1);
    for (int i = 0; i < lines.length; ++i) {
      String line = lines[i].strip();
      if (line.isEmpty() || line.startsWith("#")) {
        continue;
      }
      try {
        readLine(line);
      } catch (Fault e) {
        if (faults.size() < FAULT_COUNT_MAX) {
          faults.add((i + 1) + ": " + e.getMessage());
        }
      }
    }
  }

  /** The faulty lines, each by its number and the reason; at most 32. */
  List<String> faults() {
    return faults;
  }

  boolean isEmpty() {
    return count == 0;
  }

  /**
   * Whether a client has any grant.
   *
   * @param key null: its session is not sealed
   */
  boolean knows(byte[] key) {
    return !of(key).isEmpty();
  }

  /**
   * What a client may do with an object.
   *
   * @param key null: its session is not sealed
   * @param path null: whatever it may do with any object
   */
  Permission permission(byte[] key, Peer peer, String path) {
    Role role = null;
    int ceiling = 0;
    for (Grant grant : of(key)) {
      boolean isMeant = path == null || grant.objects.stream().anyMatch(each -> covers(each, path));
      if (isMeant && isFrom(grant, peer)) {
        role = role == null || grant.role.compareTo(role) > 0 ? grant.role : role;
        ceiling = Math.max(ceiling, grant.ceiling);
      }
    }
    return role == null ? Permission.NONE : new Permission(role, ceiling);
  }

  private List<Grant> of(byte[] key) {
    return key == null ? anonymous : byKey.getOrDefault(ByteBuffer.wrap(key), List.of());
  }

  private static boolean isFrom(Grant grant, Peer peer) {
    if (grant.from.isEmpty()) {
      return true;
    }
    byte[] address = new byte[16];
    Bytes.put64(address, 0, Long.reverseBytes(peer.high()));
    Bytes.put64(address, 8, Long.reverseBytes(peer.low()));
    return grant.from.stream().anyMatch(range -> range.contains(address));
  }

  private static boolean isSet(byte[] address, int bit) {
    return (address[bit / 8] >> (7 - bit % 8) & 1) != 0;
  }

  // `*` is one component, `**` any number of them. The latest `**` can match all that an earlier
  // one could, so that one is remembered.
  private static boolean covers(String pattern, String path) {
    String[] wanted = pattern.split("/");
    String[] given = path.split("/");
    int at = 0;
    int star = -1;
    int givenAtStar = 0;
    for (int i = 0; i < given.length; ) {
      if (at < wanted.length && wanted[at].equals(ANY)) {
        star = at++;
        givenAtStar = i;
      } else if (at < wanted.length && (wanted[at].equals("*") || wanted[at].equals(given[i]))) {
        ++at;
        ++i;
      } else if (star >= 0) {
        at = star + 1;
        i = ++givenAtStar;
      } else {
        return false;
      }
    }
    while (at < wanted.length && wanted[at].equals(ANY)) {
      ++at;
    }
    return at == wanted.length;
  }

  // ---- reading ----------------------------------------------------------------------------------

  private void readLine(String line) throws Fault {
    if (line.getBytes(StandardCharsets.UTF_8).length > LINE_SIZE_MAX) {
      throw new Fault("a line has at most " + LINE_SIZE_MAX + " bytes");
    }
    if (count == GRANT_COUNT_MAX) {
      throw new Fault("a file has at most " + GRANT_COUNT_MAX + " grants");
    }
    String[] words = line.split("[ \t\r]+");
    List<Grant> to;
    int next = 1;
    if (words[0].equals("anonymous")) {
      to = anonymous;
    } else if (words[0].startsWith("uid:")) {
      // Of callers through shared memory, which a server in Java has none of.
      to = new ArrayList<>();
    } else if (words[0].equals("rtpm25519")) {
      byte[] key = words.length > 1 ? keyOf(words[1]) : null;
      if (key == null) {
        throw new Fault("a public key has 44 characters of Base64; `rtpm key show` prints one");
      }
      next = 2;
      to = byKey.computeIfAbsent(ByteBuffer.wrap(key), any -> new ArrayList<>());
    } else {
      throw new Fault("a line begins with rtpm25519 and a key, uid:NUMBER or anonymous");
    }
    to.add(readGrant(words, next));
    ++count;
  }

  private static byte[] keyOf(String text) {
    try {
      byte[] key = Base64.getDecoder().decode(text);
      return key.length == KEY_SIZE ? key : null;
    } catch (IllegalArgumentException e) {
      return null;
    }
  }

  private static Grant readGrant(String[] words, int begin) throws Fault {
    Role role = null;
    List<String> objects = List.of();
    List<Range> from = List.of();
    int ceiling = 32767;
    Set<String> seen = new HashSet<>();
    for (int i = begin; i < words.length; ++i) {
      int equals = words[i].indexOf('=');
      if (equals < 0) {
        throw new Fault("a setting is NAME=VALUE, without spaces");
      }
      String name = words[i].substring(0, equals);
      String value = words[i].substring(equals + 1);
      if (!seen.add(name)) {
        throw new Fault("a setting is given twice");
      }
      switch (name) {
        case "name" -> {}
        case "role" -> role = roleOf(value);
        case "on" -> objects = patternsOf(value);
        case "from" -> from = rangesOf(value);
        case "max-priority" -> ceiling = numberOf(value, 32767, "a priority is 0 to 32767");
        default -> throw new Fault("the settings are name, role, on, max-priority and from");
      }
    }
    if (role == null) {
      throw new Fault("role= is missing, as role=observe");
    }
    if (objects.isEmpty()) {
      throw new Fault("on= is missing, as on=lab/** or on=**");
    }
    return new Grant(role, objects, ceiling, from);
  }

  private static Role roleOf(String value) throws Fault {
    for (Role role : Role.values()) {
      if (role.name().toLowerCase(Locale.ROOT).equals(value)) {
        return role;
      }
    }
    throw new Fault("a role is observe, command, configure or administer");
  }

  private static int numberOf(String value, int max, String what) throws Fault {
    int number = NUMBER.matcher(value).matches() ? Integer.parseInt(value) : max + 1;
    if (number > max) {
      throw new Fault(what);
    }
    return number;
  }

  private static String[] itemsOf(String value) throws Fault {
    String[] items = value.split(",", -1);
    if (items.length > ITEM_COUNT_MAX) {
      throw new Fault("a line has at most " + ITEM_COUNT_MAX + " patterns, and ranges");
    }
    return items;
  }

  private static List<String> patternsOf(String value) throws Fault {
    List<String> patterns = List.of(itemsOf(value));
    for (String pattern : patterns) {
      for (String component : pattern.split("/", -1)) {
        if (!COMPONENT.matcher(component).matches()) {
          throw new Fault("a pattern of objects is as lab/arm0, lab/* or lab/**");
        }
      }
    }
    return patterns;
  }

  private static List<Range> rangesOf(String value) throws Fault {
    List<Range> ranges = new ArrayList<>();
    for (String item : itemsOf(value)) {
      ranges.add(rangeOf(item));
    }
    return ranges;
  }

  private static Range rangeOf(String item) throws Fault {
    String what =
        "from= has addresses or ranges of them, as 192.168.7.0/24 with zeros behind 24 bits";
    int slash = item.indexOf('/');
    String text = slash < 0 ? item : item.substring(0, slash);
    boolean isIpv4 = IPV4.matcher(text).matches();
    // Only what can't be a host name: nothing is looked up.
    if (!isIpv4 && !IPV6.matcher(text).matches()) {
      throw new Fault(what);
    }
    byte[] prefix = new byte[16];
    try {
      byte[] read = InetAddress.getByName(text).getAddress();
      System.arraycopy(read, 0, prefix, prefix.length - read.length, read.length);
      if (read.length == 4) {
        Arrays.fill(prefix, 10, 12, (byte) 0xff);
      }
    } catch (UnknownHostException e) {
      throw new Fault(what);
    }
    int first = isIpv4 ? MAPPED_BITS : 0;
    int bits =
        slash < 0
            ? ADDRESS_BITS
            : first + numberOf(item.substring(slash + 1), ADDRESS_BITS - first, what);
    for (int bit = bits; bit < ADDRESS_BITS; ++bit) {
      if (isSet(prefix, bit)) {
        throw new Fault(what);
      }
    }
    return new Range(prefix, bits);
  }
}

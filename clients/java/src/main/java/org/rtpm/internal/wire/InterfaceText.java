package org.rtpm.internal.wire;

import java.util.ArrayDeque;
import java.util.ArrayList;
import java.util.Deque;
import java.util.HashMap;
import java.util.HashSet;
import java.util.List;
import java.util.Map;
import java.util.Set;

/**
 * Whether a client with one version of an interface can use a server with another, by the texts of
 * both (hp-12.2).
 */
public final class InterfaceText {
  private record MethodText(
      String id,
      String name,
      boolean isIdempotent,
      String manner,
      String request,
      String reply) {}

  private record TypeText(String head, String kind, String name, List<String> members) {}

  private record FieldText(
      String id,
      String name,
      String type,
      String typeName,
      boolean isRequired,
      boolean isOptional,
      boolean isDeprecated,
      boolean isKey,
      String defaultValue,
      String encodings,
      String unit,
      String frame) {
    boolean needsValue() {
      return isRequired && !isDeprecated;
    }
  }

  private record ValueText(String name, String number, String type) {}

  /** A text, or a part of one, that cannot be read. */
  private static final class Unreadable extends RuntimeException {
    private static final long serialVersionUID = 1L;

    Unreadable(String reason) {
      super(reason, null, false, false);
    }
  }

  private final String name;
  private final List<MethodText> methods = new ArrayList<>();
  private final Map<String, TypeText> types = new HashMap<>();

  /**
   * Compares two texts.
   *
   * @param client this program's own
   * @param server any text
   * @return null if the client understands the server; else the first difference
   */
  public static String findObstacle(String client, String server) {
    try {
      return findObstacle(new InterfaceText(client), new InterfaceText(server));
    } catch (Unreadable e) {
      return e.getMessage();
    }
  }

  private static String findObstacle(InterfaceText ours, InterfaceText theirs) {
    if (!ours.name.equals(theirs.name)) {
      return "the interface is " + twoSides(theirs.name, ours.name);
    }
    for (MethodText method : ours.methods) {
      String words = "method '" + method.name + "' (id " + method.id + ")";
      MethodText other = null;
      for (MethodText candidate : theirs.methods) {
        other = other == null && candidate.id.equals(method.id) ? candidate : other;
      }
      if (other == null) {
        return words + " is missing there";
      }
      String difference = compareMethods(ours, method, theirs, other);
      if (difference != null) {
        return words + ": " + difference;
      }
    }
    return null;
  }

  private static String compareMethods(
      InterfaceText client, MethodText here, InterfaceText server, MethodText there) {
    if (!here.name.equals(there.name)) {
      return "it is " + twoSides(there.name, here.name);
    }
    if (!here.manner.equals(there.manner)) {
      return "it is called as " + twoSides(there.manner, here.manner);
    }
    if (here.isIdempotent && !there.isIdempotent) {
      return "it is idempotent here, so that it would be repeated, and not there";
    }
    if (!here.request.equals(there.request)) {
      return "it takes " + twoSides(there.request, here.request);
    }
    if (!here.reply.equals(there.reply)) {
      return "it gives " + twoSides(there.reply, here.reply);
    }
    String difference = new Comparison(client, server, true).run(behindWord(here.request));
    return difference != null
        ? difference
        : new Comparison(client, server, false).run(behindWord(here.reply));
  }

  private static String twoSides(String there, String here) {
    return "'" + there + "' there and '" + here + "' here";
  }

  private static String behindWord(String text) {
    int space = text.indexOf(' ');
    return space < 0 ? "" : text.substring(space + 1);
  }

  // ---- reading ----------------------------------------------------------------------------------

  private InterfaceText(String text) {
    Deque<String> lines = new ArrayDeque<>(List.of(text.split("\n", -1)));
    if (!text.isEmpty() && text.endsWith("\n")) {
      lines.removeLast();
    }
    name = behind("service ", lines);
    while (!lines.isEmpty()) {
      String line = lines.poll();
      if (line.startsWith("method ")) {
        methods.add(readMethod(line.substring("method ".length()), lines));
      } else {
        TypeText type = readType(line, lines);
        if (types.put(type.name, type) != null) {
          throw new Unreadable("the text has a type twice");
        }
      }
    }
  }

  private static String behind(String begin, Deque<String> lines) {
    String line = lines.poll();
    if (line == null || !line.startsWith(begin)) {
      throw new Unreadable("the text of an interface cannot be read");
    }
    return line.substring(begin.length());
  }

  private static MethodText readMethod(String line, Deque<String> rest) {
    String[] words = line.split(" ", 3);
    if (words.length < 2 || words[1].isEmpty()) {
      throw new Unreadable("a method cannot be read");
    }
    String manner = words.length < 3 ? "" : words[2];
    boolean isIdempotent = manner.equals("idempotent") || manner.startsWith("idempotent ");
    if (isIdempotent) {
      manner = behindWord(manner);
    }
    return new MethodText(
        words[0], words[1], isIdempotent, manner, behind("request ", rest), behind("reply ", rest));
  }

  private static TypeText readType(String line, Deque<String> rest) {
    if (!line.endsWith(" {")) {
      throw new Unreadable("a type cannot be read");
    }
    String head = line.substring(0, line.length() - 2);
    String[] words = head.split(" ");
    List<String> members = new ArrayList<>();
    while (!rest.isEmpty()) {
      String member = rest.poll();
      if (member.equals("}")) {
        return new TypeText(head, words[0], words.length < 2 ? "" : words[1], members);
      }
      if (!member.startsWith("  ")) {
        break;
      }
      members.add(member.substring(2));
    }
    throw new Unreadable("a type does not end");
  }

  private static boolean isRule(String word) {
    return Set.of("required", "optional", "deprecated", "key", "=").contains(word)
        || word.contains(":");
  }

  private static FieldText readField(String line) {
    int space = line.indexOf(' ');
    int colon = line.indexOf(": ");
    if (space < 0 || colon < space + 2) {
      throw new Unreadable("a field cannot be read");
    }
    String rest = line.substring(colon + 2);
    // From the end, because units and frames may contain spaces.
    String frame = quotedEnd(rest, " frame \"");
    rest = frame.isEmpty() ? rest : rest.substring(0, rest.indexOf(" frame \""));
    String unit = quotedEnd(rest, " in \"");
    rest = unit.isEmpty() ? rest : rest.substring(0, rest.indexOf(" in \""));
    Deque<String> words = new ArrayDeque<>(List.of(rest.split(" ")));
    String type = words.poll();
    String typeName = words.isEmpty() || isRule(words.peek()) ? "" : words.poll();
    Set<String> rules = new HashSet<>();
    String defaultValue = "";
    StringBuilder encodings = new StringBuilder();
    while (!words.isEmpty()) {
      String word = words.poll();
      if (encodings.length() == 0 && word.equals("=") && !words.isEmpty()) {
        defaultValue = words.poll();
      } else if (encodings.length() == 0
          && Set.of("required", "optional", "deprecated", "key").contains(word)) {
        rules.add(word);
      } else {
        // hp-12.2-1: an unknown rule must be the same on both sides.
        encodings.append(' ').append(word);
      }
    }
    return new FieldText(
        line.substring(0, space),
        line.substring(space + 1, colon),
        type,
        typeName,
        rules.contains("required"),
        rules.contains("optional"),
        rules.contains("deprecated"),
        rules.contains("key"),
        defaultValue,
        encodings.toString(),
        unit,
        frame);
  }

  private static String quotedEnd(String text, String begin) {
    int at = text.indexOf(begin);
    return at >= 0 && text.endsWith("\"") && text.length() > at + begin.length()
        ? text.substring(at + begin.length(), text.length() - 1)
        : "";
  }

  private static ValueText readValue(String line) {
    int equals = line.indexOf(" = ");
    if (equals < 1) {
      throw new Unreadable("a value cannot be read");
    }
    String rest = line.substring(equals + 3);
    int colon = rest.indexOf(": ");
    return new ValueText(
        line.substring(0, equals),
        colon < 0 ? rest : rest.substring(0, colon),
        colon < 0 ? "" : rest.substring(colon + 2));
  }

  // ---- comparing --------------------------------------------------------------------------------

  /** Compares the types of one message, from its table on. */
  private static final class Comparison {
    private final InterfaceText client;
    private final InterfaceText server;
    /** The client writes. */
    private final boolean isRequest;
    private final Set<String> seen = new HashSet<>();
    private final Deque<String> open = new ArrayDeque<>();

    Comparison(InterfaceText client, InterfaceText server, boolean isRequest) {
      this.client = client;
      this.server = server;
      this.isRequest = isRequest;
    }

    String run(String table) {
      reach(table);
      while (!open.isEmpty()) {
        String difference = compare(open.pop());
        if (difference != null) {
          return difference;
        }
      }
      return null;
    }

    private void reach(String name) {
      if (!name.isEmpty() && seen.add(name)) {
        open.push(name);
      }
    }

    private String compare(String name) {
      TypeText here = client.types.get(name);
      TypeText there = server.types.get(name);
      if (here == null || there == null) {
        return "type '" + name + "' is missing in the text of one side";
      }
      if (!here.head.equals(there.head)) {
        return "a type is " + twoSides(there.head, here.head);
      }
      boolean isStruct = here.kind.equals("struct");
      if (isStruct && here.members.size() != there.members.size()) {
        return "struct '" + name + "' has other fields there";
      }
      return isStruct || here.kind.equals("table")
          ? compareFields(here, there)
          : compareValues(here, there);
    }

    private String compareFields(TypeText here, TypeText there) {
      TypeText writer = isRequest ? here : there;
      TypeText reader = isRequest ? there : here;
      for (String line : reader.members) {
        FieldText wanted = readField(line);
        FieldText written = null;
        for (String candidate : writer.members) {
          if (candidate.startsWith(wanted.id + " ")) {
            written = readField(candidate);
          }
        }
        if (written == null) {
          if (!here.kind.equals("struct") && !wanted.needsValue()) {
            continue;
          }
          return "field '" + line + "' of '" + here.head + "' is missing on one side";
        }
        if (!isSame(written, wanted)) {
          return "field " + wanted.id + " of '" + here.head + "' differs: '" + line + "'";
        }
        reach(wanted.typeName);
      }
      return null;
    }

    private static boolean isSame(FieldText written, FieldText wanted) {
      if (!written.name.equals(wanted.name)
          || !written.type.equals(wanted.type)
          || !written.typeName.equals(wanted.typeName)
          || written.isKey != wanted.isKey
          || !written.encodings.equals(wanted.encodings)
          || !agree(written.unit, wanted.unit)
          || !agree(written.frame, wanted.frame)
          || (wanted.needsValue() && !written.needsValue())) {
        return false;
      }
      // A deprecated field is neither written nor read.
      if (written.isDeprecated || wanted.isDeprecated) {
        return true;
      }
      return written.defaultValue.equals(wanted.defaultValue)
          && (wanted.defaultValue.isEmpty() || written.isOptional == wanted.isOptional);
    }

    // One side leaves it open, or both state the same.
    private static boolean agree(String a, String b) {
      return a.isEmpty() || b.isEmpty() || a.equals(b);
    }

    private String compareValues(TypeText here, TypeText there) {
      for (String line : here.members) {
        ValueText ours = readValue(line);
        for (String other : there.members) {
          ValueText theirs = readValue(other);
          boolean isName = ours.name.equals(theirs.name);
          if (isName != ours.number.equals(theirs.number)
              || (isName && !ours.type.equals(theirs.type))) {
            return "a value of '" + here.head + "' is " + twoSides(other, line);
          }
          if (isName) {
            reach(behindWord(ours.type));
          }
        }
      }
      return null;
    }
  }
}

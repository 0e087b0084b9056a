package org.rtpm.vectors;

import static org.junit.jupiter.api.Assertions.assertNotEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.util.HashMap;
import java.util.LinkedHashMap;
import java.util.Map;
import java.util.regex.Matcher;
import java.util.regex.Pattern;

/**
 * The bytes that one side is free to choose: {@code <name>} in a vector's hex. The tested
 * side's are learned from the first frame that has them; the other side's are the examples.
 */
final class FreeBytes {
  private static final Pattern NAME = Pattern.compile("<([^>]*)>");

  private final Map<String, Integer> sizes = new HashMap<>();
  private final Map<String, String> known = new HashMap<>();

  FreeBytes(Json free, String side) {
    for (String name : free.keys()) {
      Json choice = free.at(name);
      sizes.put(name, choice.at("size").integer());
      if (!choice.at("chosen_by").text().equals(side)) {
        known.put(name, choice.at("example").text());
      }
    }
  }

  /** The hex of a frame that is given to the tested side. */
  String fillIn(String pattern) {
    return NAME.matcher(pattern)
        .replaceAll(
            found -> {
              String bytes = known.get(found.group(1));
              assertTrue(bytes != null, found.group() + " is used before it was sent");
              return bytes;
            });
  }

  /** Whether a frame of the tested side is as the pattern says; learns new names. */
  boolean matches(String pattern, String hex) {
    Map<String, String> learned = new LinkedHashMap<>();
    Matcher names = NAME.matcher(pattern);
    int at = 0;
    int behind = 0;
    while (names.find()) {
      String before = pattern.substring(behind, names.start());
      behind = names.end();
      int begin = at + before.length();
      int end = begin + 2 * sizes.get(names.group(1));
      if (!hex.startsWith(before, at) || end > hex.length()) {
        return false;
      }
      String here = hex.substring(begin, end);
      String wanted = known.getOrDefault(names.group(1), learned.get(names.group(1)));
      if (wanted != null && !wanted.equals(here)) {
        return false;
      }
      learned.put(names.group(1), here);
      at = end;
    }
    if (!hex.substring(at).equals(pattern.substring(behind))) {
      return false;
    }
    learned.forEach(this::learn);
    return true;
  }

  /** A number, written as itself or as a name. */
  long number(Json value) {
    return value.isNumber() ? value.number() : littleEndian(fillIn(value.text()));
  }

  private void learn(String name, String value) {
    if (known.containsKey(name)) {
      return;
    }
    String kind = kindOf(name);
    known.forEach(
        (other, otherValue) -> {
          if (!kindOf(other).equals(kind) || kind.equals("cookie")) {
            return;
          }
          assertNotEquals(otherValue, value, name + " and " + other + " are different choices");
          if (kind.equals("call")) {
            int step = (int) (littleEndian(value) - littleEndian(otherValue));
            assertTrue(step > 0, name + " is later than " + other);
          }
        });
    known.put(name, value);
  }

  private static String kindOf(String name) {
    return name.replaceAll("[0-9]+$", "");
  }

  private static long littleEndian(String hex) {
    long value = 0;
    for (int at = hex.length() - 2; at >= 0; at -= 2) {
      value = value << 8 | Integer.parseInt(hex.substring(at, at + 2), 16);
    }
    return value;
  }
}

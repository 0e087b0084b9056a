package org.rtpm.vectors;

import java.io.IOException;
import java.io.UncheckedIOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.HexFormat;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;

/** A value of JSON: just enough to read the vectors. */
final class Json {
  /** Map, List, String, Long, Double, Boolean or null. */
  private final Object value;

  private Json(Object value) {
    this.value = value;
  }

  /** Reads a file of spec/vectors. */
  static Json vectors(String name) {
    try {
      return new Json(new Reader(Files.readString(folder().resolve(name))).whole());
    } catch (IOException e) {
      throw new UncheckedIOException(e);
    }
  }

  static Path folder() {
    return Path.of(System.getProperty("rtpm.spec", "../../spec"), "vectors");
  }

  boolean has(String key) {
    return value instanceof Map<?, ?> map && map.containsKey(key);
  }

  Json at(String key) {
    if (!has(key)) {
      throw new AssertionError("no '" + key + "' in " + this);
    }
    return new Json(((Map<?, ?>) value).get(key));
  }

  String text() {
    return (String) value;
  }

  String text(String key, String otherwise) {
    return has(key) ? at(key).text() : otherwise;
  }

  boolean flag() {
    return (Boolean) value;
  }

  boolean flag(String key) {
    return has(key) && at(key).flag();
  }

  boolean isNumber() {
    return value instanceof Long;
  }

  /** A number, or a text "0x…" of 64 bits. */
  long number() {
    return value instanceof String text
        ? Long.parseUnsignedLong(text.substring(2), 16)
        : (Long) value;
  }

  long number(String key, long otherwise) {
    return has(key) ? at(key).number() : otherwise;
  }

  int integer() {
    return (int) number();
  }

  byte[] bytes() {
    return HexFormat.of().parseHex(text());
  }

  List<Json> list() {
    List<Json> all = new ArrayList<>();
    for (Object each : (List<?>) value) {
      all.add(new Json(each));
    }
    return all;
  }

  List<String> keys() {
    List<String> all = new ArrayList<>();
    for (Object key : ((Map<?, ?>) value).keySet()) {
      all.add((String) key);
    }
    return all;
  }

  @Override
  public String toString() {
    return String.valueOf(value);
  }

  private static final class Reader {
    private final String text;
    private int at;

    Reader(String text) {
      this.text = text;
    }

    Object whole() {
      Object read = value();
      skipSpace();
      if (at != text.length()) {
        throw fault();
      }
      return read;
    }

    private AssertionError fault() {
      return new AssertionError("no JSON at " + at);
    }

    private void skipSpace() {
      while (at < text.length() && Character.isWhitespace(text.charAt(at))) {
        ++at;
      }
    }

    private boolean take(String begin) {
      skipSpace();
      if (!text.startsWith(begin, at)) {
        return false;
      }
      at += begin.length();
      return true;
    }

    private void expect(String begin) {
      if (!take(begin)) {
        throw fault();
      }
    }

    private Object value() {
      if (take("{")) {
        return object();
      }
      if (take("[")) {
        return array();
      }
      if (take("\"")) {
        return string();
      }
      if (take("true")) {
        return Boolean.TRUE;
      }
      if (take("false")) {
        return Boolean.FALSE;
      }
      if (take("null")) {
        return null;
      }
      int begin = at;
      while (at < text.length() && "+-.eE0123456789".indexOf(text.charAt(at)) >= 0) {
        ++at;
      }
      String number = text.substring(begin, at);
      if (number.matches("-?[0-9]+")) {
        return Long.valueOf(number);
      }
      return Double.valueOf(number);
    }

    private Map<String, Object> object() {
      Map<String, Object> map = new LinkedHashMap<>();
      if (take("}")) {
        return map;
      }
      do {
        expect("\"");
        String key = string();
        expect(":");
        map.put(key, value());
      } while (take(","));
      expect("}");
      return map;
    }

    private List<Object> array() {
      List<Object> list = new ArrayList<>();
      if (take("]")) {
        return list;
      }
      do {
        list.add(value());
      } while (take(","));
      expect("]");
      return list;
    }

    private String string() {
      StringBuilder to = new StringBuilder();
      while (true) {
        char c = text.charAt(at++);
        if (c == '"') {
          return to.toString();
        }
        if (c != '\\') {
          to.append(c);
          continue;
        }
        char escaped = text.charAt(at++);
        switch (escaped) {
          case 'n' -> to.append('\n');
          case 't' -> to.append('\t');
          case 'r' -> to.append('\r');
          case 'b' -> to.append('\b');
          case 'f' -> to.append('\f');
          case 'u' -> {
            to.append((char) Integer.parseInt(text.substring(at, at + 4), 16));
            at += 4;
          }
          default -> to.append(escaped);
        }
      }
    }
  }
}

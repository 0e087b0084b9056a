package org.rtpm.conform;

import java.io.BufferedReader;
import java.io.IOException;
import java.io.InputStreamReader;
import java.net.InetSocketAddress;
import java.nio.charset.StandardCharsets;
import java.util.HashMap;
import java.util.HexFormat;
import java.util.Locale;
import java.util.Map;
import org.rtpm.Status;
import org.rtpm.internal.wire.DropReason;

/**
 * The program under test of spec/conform/rtpm-conform, by its line protocol: a client or a server
 * made of the protocol's core and a socket.
 */
public abstract class Subject {
  /** A line of the tool: its words, and its {@code name=value} pairs. */
  record Line(String[] words, Map<String, String> values) {
    static Line parse(String text) {
      Map<String, String> values = new HashMap<>();
      StringBuilder words = new StringBuilder();
      for (String part : text.trim().split("\\s+")) {
        int equals = part.indexOf('=');
        if (equals > 0) {
          values.put(part.substring(0, equals), part.substring(equals + 1));
        } else {
          words.append(words.isEmpty() ? "" : " ").append(part);
        }
      }
      return new Line(words.toString().split(" "), values);
    }

    String word(int index) {
      return index < words.length ? words[index] : "";
    }

    String text(String name, String otherwise) {
      return values.getOrDefault(name, otherwise);
    }

    long number(String name, long otherwise) {
      String text = values.get(name);
      if (text == null) {
        return otherwise;
      }
      return text.startsWith("0x")
          ? Long.parseUnsignedLong(text.substring(2), 16)
          : Long.parseUnsignedLong(text);
    }

    int integer(String name, int otherwise) {
      return (int) number(name, otherwise);
    }

    byte[] payload() {
      return HexFormat.of().parseHex(text("payload", ""));
    }

    Status status() {
      return Status.valueOf(text("status", "ok").toUpperCase(Locale.ROOT));
    }

    InetSocketAddress address() {
      String address = text("address", "");
      int colon = address.lastIndexOf(':');
      return new InetSocketAddress(
          address.substring(0, colon), Integer.parseInt(address.substring(colon + 1)));
    }
  }

  public static void main(String[] arguments) throws IOException {
    Subject subject = null;
    BufferedReader in =
        new BufferedReader(new InputStreamReader(System.in, StandardCharsets.UTF_8));
    for (String text; (text = in.readLine()) != null && !text.equals("quit"); ) {
      Line line = Line.parse(text);
      switch (line.word(0)) {
        case "setup" -> {
          if (line.text("level", "").equals("bindings")) {
            say("cannot play bindings: see the unit tests");
          } else {
            subject =
                line.text("role", "").equals("server")
                    ? new ServerSubject(line)
                    : new ClientSubject(line);
          }
        }
        case "counters" -> say(subject == null ? "counters unknown" : subject.counted());
        case "does" -> {
          synchronized (subject) {
            subject.does(line);
          }
        }
        default -> say("cannot " + line.word(0));
      }
    }
    System.exit(0);
  }

  static synchronized void say(String line) {
    System.out.println(line);
    System.out.flush();
  }

  static String hex(byte[] bytes) {
    return HexFormat.of().formatHex(bytes);
  }

  abstract void does(Line line) throws IOException;

  abstract long dropped(DropReason reason);

  /** Lets the protocol do what its clock says. */
  abstract void tick();

  private synchronized String counted() {
    StringBuilder counted = new StringBuilder("counters");
    for (DropReason reason : DropReason.values()) {
      counted.append(' ').append(reason).append('=').append(dropped(reason));
    }
    return counted.toString();
  }

  /** Ticks each other millisecond, for as long as the program runs. */
  final void startClock() {
    startThread(
        () -> {
          while (true) {
            Thread.sleep(2);
            synchronized (this) {
              tick();
            }
          }
        });
  }

  /** Part of a subject that waits. */
  @FunctionalInterface
  interface Waiting {
    void run() throws IOException, InterruptedException;
  }

  static void startThread(Waiting waiting) {
    Thread thread =
        new Thread(
            () -> {
              try {
                waiting.run();
              } catch (IOException | InterruptedException e) {
                // The socket is closed: the side that waited on it has ended.
              }
            });
    thread.setDaemon(true);
    thread.start();
  }
}

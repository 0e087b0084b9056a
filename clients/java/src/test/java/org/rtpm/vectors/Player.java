package org.rtpm.vectors;

import java.util.ArrayList;
import java.util.HexFormat;
import java.util.List;
import java.util.Map;
import java.util.TreeMap;
import java.util.stream.Stream;

/** Plays one side of a conversation, and compares what the side does with the vector. */
final class Player {
  private enum StepIs {
    INPUT,
    OUTPUT,
    NOTHING
  }

  private final String self;
  private final String other;
  private final Side side;
  private final FreeBytes free;
  private List<Output> outputs = new ArrayList<>();

  private Player(Json conversation, String self, Side side) {
    this.self = self;
    this.side = side;
    other = self.equals("client") ? "server" : "client";
    free = new FreeBytes(conversation.at("free"), self);
  }

  /** Returns the first deviation; null if there is none. */
  static String play(Json conversation, String self) {
    return play(conversation, conversation.at("steps").list(), self);
  }

  static String play(Json conversation, List<Json> steps, String self) {
    Side side =
        self.equals("client") ? new ClientSide(conversation) : new ServerSide(conversation);
    return play(conversation, steps, self, side);
  }

  static String play(Json conversation, List<Json> steps, String self, Side side) {
    Player player = new Player(conversation, self, side);
    for (int i = 0; i < steps.size(); ++i) {
      String fault = player.take(steps.get(i));
      if (fault != null) {
        return "step " + i + ": " + fault;
      }
    }
    return player.surplus();
  }

  /** Whether the step is what the side has to do. */
  static boolean isOutput(Json step, String self) {
    return step.text("frame", "").startsWith(self) || step.has(self + "_sees");
  }

  private String take(Json step) {
    return switch (judge(step)) {
      case NOTHING -> null;
      case OUTPUT -> consume(step);
      case INPUT -> {
        String surplus = surplus();
        if (surplus == null) {
          apply(step);
        }
        yield surplus;
      }
    };
  }

  private StepIs judge(Json step) {
    if (step.has("frame")) {
      String way = step.at("frame").text();
      if (way.equals(self + " to " + other)) {
        return StepIs.OUTPUT;
      }
      boolean isInput =
          way.equals("network to " + self)
              || (way.equals(other + " to " + self) && !step.flag("is_lost"));
      return isInput ? StepIs.INPUT : StepIs.NOTHING;
    }
    if (step.has(self + "_sees") || step.has(self + "_counts")) {
      return StepIs.OUTPUT;
    }
    return step.has(self + "_does") || step.has("network_does") ? StepIs.INPUT : StepIs.NOTHING;
  }

  private void apply(Json step) {
    long now = step.number("arrives_ns", step.at("at_ns").number());
    if (step.has("frame")) {
      byte[] frame = HexFormat.of().parseHex(free.fillIn(step.at("hex").text()));
      outputs = side.receive(frame, !step.text("address", "client").equals("client"), now);
    } else {
      outputs = side.act(step, free, now);
    }
  }

  private String surplus() {
    return outputs.isEmpty() ? null : "not in the vector: " + outputs;
  }

  private String consume(Json step) {
    for (int i = 0; i < outputs.size(); ++i) {
      if (isWanted(outputs.get(i), step)) {
        outputs.remove(i);
        return null;
      }
    }
    return "wanted: " + step + "\nbut: " + outputs;
  }

  private boolean isWanted(Output output, Json step) {
    if (step.has("frame") != (output.hex() != null)) {
      return false;
    }
    if (output.hex() != null) {
      return free.matches(step.at("hex").text(), output.hex());
    }
    Map<String, String> wanted = new TreeMap<>();
    for (String key : step.keys()) {
      if (key.equals("call_id")) {
        wanted.put(key, Integer.toUnsignedString((int) free.number(step.at(key))));
      } else if (!key.equals("at_ns")) {
        wanted.put(key, step.at(key).toString());
      }
    }
    Map<String, String> there = new TreeMap<>(output.words());
    // With one open call a vector need not name it.
    if (!wanted.containsKey("call_id")) {
      there.remove("call_id");
    }
    return there.equals(wanted);
  }

  /** The names of all conversations. */
  static List<String> names() {
    try (Stream<java.nio.file.Path> files =
        java.nio.file.Files.list(Json.folder().resolve("conversations"))) {
      return files
          .map(file -> file.getFileName().toString())
          .filter(name -> name.endsWith(".json"))
          .map(name -> name.substring(0, name.length() - 5))
          .sorted()
          .toList();
    } catch (java.io.IOException e) {
      throw new java.io.UncheckedIOException(e);
    }
  }

  static Json read(String name) {
    return Json.vectors("conversations/" + name + ".json");
  }
}

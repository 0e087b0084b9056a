package org.rtpm.vectors;

import java.util.HexFormat;
import java.util.Map;
import java.util.TreeMap;

/** An action of the tested side: a frame that it sent, or a step's words. */
record Output(String hex, Map<String, String> words) {
  static Output frame(byte[] frame) {
    return new Output(HexFormat.of().formatHex(frame), null);
  }

  static Output words(String... pairs) {
    Map<String, String> words = new TreeMap<>();
    for (int i = 0; i < pairs.length; i += 2) {
      words.put(pairs[i], pairs[i + 1]);
    }
    return new Output(null, words);
  }
}

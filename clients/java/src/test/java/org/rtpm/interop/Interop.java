package org.rtpm.interop;

import java.io.IOException;
import java.nio.file.Path;
import java.util.HashMap;
import java.util.HashSet;
import java.util.Map;
import java.util.Set;
import org.rtpm.PrivateKey;
import org.rtpm.PublicKey;
import org.rtpm.Transport;

/** Java's program of the matrix of languages; see tests/interop/README.md. */
public final class Interop {
  private static final int EXIT_MISUSE = 2;

  /** The options of the command line. */
  record Options(Map<String, String> values, Set<String> flags) {
    /** Null if it was not given. */
    String get(String name) {
      return values.get(name);
    }

    PrivateKey key() throws IOException {
      return get("--key") == null ? null : PrivateKey.read(Path.of(get("--key")));
    }

    PublicKey publicKey(String name) {
      return get(name) == null ? null : PublicKey.parse(get(name));
    }

    Transport transport() {
      return "tcp".equals(get("--transport")) ? Transport.TCP : Transport.UDP;
    }
  }

  private Interop() {}

  public static void main(String[] arguments) throws Exception {
    String verb = arguments.length == 0 ? "" : arguments[0];
    if (verb.equals("serve")) {
      new InteropServer(read(arguments, 1)).run();
      System.exit(0);
    }
    if (verb.equals("check") && arguments.length > 1) {
      boolean isGood = new InteropCheck(arguments[1], read(arguments, 2)).run();
      System.exit(isGood ? 0 : 1);
    }
    misuse("serve … or check URL …");
  }

  private static Options read(String[] arguments, int begin) {
    Map<String, String> values = new HashMap<>();
    Set<String> flags = new HashSet<>();
    for (int i = begin; i < arguments.length; ++i) {
      if (arguments[i].equals("--lossy")) {
        flags.add(arguments[i]);
      } else if (i + 1 < arguments.length) {
        values.put(arguments[i], arguments[++i]);
      } else {
        misuse(arguments[i] + " has no value");
      }
    }
    return new Options(values, flags);
  }

  private static void misuse(String fault) {
    System.err.println("interop: " + fault + "; see tests/interop/README.md");
    System.exit(EXIT_MISUSE);
  }
}

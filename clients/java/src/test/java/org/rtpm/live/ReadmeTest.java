package org.rtpm.live;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.BufferedReader;
import java.io.File;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.List;
import java.util.Map;
import java.util.TreeMap;
import java.util.concurrent.TimeUnit;
import java.util.regex.Matcher;
import java.util.regex.Pattern;
import javax.tools.ToolProvider;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.Timeout;
import org.junit.jupiter.api.io.TempDir;
import org.rtpm.Node;

/** The whole programs in README.md are compiled, and run beside a simulated device. */
@Timeout(60)
class ReadmeTest {
  @TempDir Path home;

  // A program begins with an import and ends with the class's brace, indented by 4.
  private static Map<String, String> programs() throws Exception {
    String text = Files.readString(Path.of(System.getProperty("basedir"), "README.md"));
    Matcher each =
        Pattern.compile("(?ms)^    import .*?^    class (\\w+) \\{.*?^    \\}$").matcher(text);
    Map<String, String> found = new TreeMap<>();
    while (each.find()) {
      found.put(each.group(1), each.group());
    }
    return found;
  }

  // A reader has the jar instead.
  private static String classes() throws Exception {
    return Path.of(Node.class.getProtectionDomain().getCodeSource().getLocation().toURI())
        .toString();
  }

  private Process start(String registry, String name, String... arguments) throws Exception {
    ProcessBuilder builder =
        new ProcessBuilder(
            Path.of(System.getProperty("java.home"), "bin", "java").toString(),
            "-XX:TieredStopAtLevel=1",
            "-cp",
            classes() + File.pathSeparator + home,
            name);
    builder.command().addAll(List.of(arguments));
    builder.environment().put("RTPM_REGISTRY", registry);
    return builder.redirectErrorStream(true).start();
  }

  private String run(String registry, String name, String... arguments) throws Exception {
    Process process = start(registry, name, arguments);
    String printed = new String(process.getInputStream().readAllBytes());
    assertEquals(0, process.waitFor(), printed);
    return printed;
  }

  @Test
  void programsRun() throws Exception {
    Program.assumeBuilt("rtpm-registryd", "rtpm-deviced");
    Map<String, String> programs = programs();
    assertEquals("[Position, Push, SoftStart, Watch]", programs.keySet().toString());
    for (Map.Entry<String, String> each : programs.entrySet()) {
      Path file = home.resolve(each.getKey() + ".java");
      Files.writeString(file, each.getValue());
      String[] options = {"-Xlint:all", "-Werror", "-cp", classes(), file.toString()};
      assertEquals(
          0, ToolProvider.getSystemJavaCompiler().run(null, System.err, System.err, options));
    }
    try (Program registry = Program.start(home, "rtpm-registryd", "--port", "0")) {
      String url = registry.address();
      try (Program devices =
          Program.start(
              home, "rtpm-deviced", "--registry", url, "--port", "0", "--serve-events",
              "--stops", "none", "--settings", "")) {
        devices.address();
        // The forms of a registry with and without its path.
        String server = url.substring(0, url.indexOf("/rtpm/names"));
        assertTrue(run(server, "Position", "lab/arm0").matches("(?s)\\S+ \\S+ \\S+\\R"));
        assertEquals("done", run(url, "SoftStart").strip());
        Process watch = start(url, "Watch");
        try (BufferedReader seen = watch.inputReader()) {
          for (int i = 0; i < 5 && !seen.ready(); ++i) {
            String pushed = run(url, "Push");
            assertTrue(pushed.contains("N towards the operator"), pushed);
            assertTrue(pushed.contains("ACTIVE ["), pushed);
          }
          assertTrue(Double.parseDouble(seen.readLine()) > 0.5);
        } finally {
          watch.destroyForcibly().waitFor(5, TimeUnit.SECONDS);
        }
      }
    }
  }
}

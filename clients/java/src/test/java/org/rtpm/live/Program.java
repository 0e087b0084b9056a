package org.rtpm.live;

import java.io.BufferedReader;
import java.io.IOException;
import java.io.InputStreamReader;
import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.concurrent.TimeUnit;
import org.junit.jupiter.api.Assumptions;

/** A program of RTPM in C++, which a test starts. */
final class Program implements AutoCloseable {
  private final Process process;
  private final BufferedReader output;

  private Program(Process process) {
    this.process = process;
    output =
        new BufferedReader(
            new InputStreamReader(process.getInputStream(), StandardCharsets.UTF_8));
  }

  /** Skips the test where the programs are not built. */
  static void assumeBuilt(String... names) {
    for (String name : names) {
      Assumptions.assumeTrue(
          Files.isExecutable(folder().resolve(name)), name + " is not built in " + folder());
    }
  }

  private static Path folder() {
    return Path.of(System.getProperty("rtpm.programs", "/nowhere"));
  }

  /**
   * Starts a program.
   *
   * @param home its home folder, so that it reads no settings of a person
   */
  static Program start(Path home, String name, String... arguments) throws IOException {
    List<String> command = new ArrayList<>();
    command.add(folder().resolve(name).toString());
    command.addAll(List.of(arguments));
    ProcessBuilder builder = new ProcessBuilder(command).redirectErrorStream(true);
    builder.environment().put("HOME", home.toString());
    builder.environment().remove("XDG_CONFIG_HOME");
    builder.environment().remove("XDG_STATE_HOME");
    return new Program(builder.start());
  }

  /** Waits for a line with an address, and returns that. */
  String address() throws IOException {
    for (String line; (line = output.readLine()) != null; ) {
      int at = line.indexOf("rtpm://");
      if (at >= 0) {
        return line.substring(at).split("[ ,]")[0];
      }
    }
    throw new IOException("the program told no address");
  }

  /** Waits for the program's end, and returns all that it printed. */
  String all() throws IOException, InterruptedException {
    StringBuilder all = new StringBuilder();
    for (String line; (line = output.readLine()) != null; ) {
      all.append(line).append('\n');
    }
    process.waitFor(10, TimeUnit.SECONDS);
    return all.toString();
  }

  @Override
  public void close() {
    process.destroy();
    try {
      if (!process.waitFor(5, TimeUnit.SECONDS)) {
        process.destroyForcibly();
      }
    } catch (InterruptedException e) {
      process.destroyForcibly();
      Thread.currentThread().interrupt();
    }
  }
}

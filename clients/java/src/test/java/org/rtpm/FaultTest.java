package org.rtpm;

import static org.junit.jupiter.api.Assertions.assertEquals;

import java.nio.file.Files;
import java.nio.file.Path;
import java.util.EnumSet;
import java.util.Locale;
import java.util.Map;
import java.util.TreeMap;
import java.util.regex.Matcher;
import java.util.regex.Pattern;
import org.junit.jupiter.api.Test;

/** The numbers of a sample against those of the device server in C++. */
class FaultTest {
  // The enumerators of C++, as Java writes them, with their numbers.
  private static Map<String, Long> enumerators(String enumeration, String number)
      throws Exception {
    Path header =
        Path.of(System.getProperty("rtpm.spec"), "../gvd/driver/include/rtpm/driver/sample.hpp");
    String text = Files.readString(header);
    int begin = text.indexOf("enum class " + enumeration + " ");
    String body = text.substring(begin, text.indexOf("};", begin));
    Map<String, Long> found = new TreeMap<>();
    Matcher each = Pattern.compile("\\bk(\\w+)\\s*=\\s*" + number).matcher(body);
    while (each.find()) {
      String name = each.group(1).replaceAll("(?<=[a-z])(?=[A-Z])", "_");
      found.put(name.toUpperCase(Locale.ROOT), Long.parseLong(each.group(2)));
    }
    return found;
  }

  @Test
  void bitsAreThoseOfTheDeviceServer() throws Exception {
    Map<String, Long> own = new TreeMap<>();
    for (Fault fault : Fault.values()) {
      own.put(fault.name(), (long) Long.numberOfTrailingZeros(fault.bit()));
    }
    assertEquals(enumerators("Fault", "1u << (\\d+)"), own);
  }

  @Test
  void faultsAreASet() {
    assertEquals(EnumSet.noneOf(Fault.class), Fault.of(0));
    assertEquals(
        EnumSet.of(Fault.DEVICE_LATE, Fault.SOFT_START), Fault.of(1 | 1 << 12 | 1L << 31));
  }

  @Test
  void lifecyclesAreThoseOfTheDeviceServer() throws Exception {
    Map<String, Long> own = new TreeMap<>();
    for (Lifecycle lifecycle : EnumSet.complementOf(EnumSet.of(Lifecycle.UNKNOWN))) {
      own.put(lifecycle.name(), (long) lifecycle.ordinal());
      assertEquals(lifecycle, Lifecycle.of(lifecycle.ordinal()));
    }
    assertEquals(enumerators("Lifecycle", "(\\d+)"), own);
    assertEquals(Lifecycle.UNKNOWN, Lifecycle.of(own.size()));
    assertEquals(Lifecycle.UNKNOWN, Lifecycle.of(-1));
  }
}

package org.rtpm.live;

import static org.junit.jupiter.api.Assertions.assertEquals;

import java.nio.file.Path;
import java.util.List;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.Timeout;
import org.junit.jupiter.api.io.TempDir;
import org.rtpm.Binding;
import org.rtpm.Node;
import rtpm.configuration.ApplyRequest;
import rtpm.configuration.ConfigurationClient;
import rtpm.configuration.ConfigurationMethods;
import rtpm.configuration.ListReply;
import rtpm.configuration.OutcomeCode;
import rtpm.configuration.Parameter;
import rtpm.configuration.Setting;
import rtpm.configuration.Value;

/** The parameters of a device of RTPM's own device server. */
@Timeout(60)
class ConfigurationTest {
  @TempDir private Path home;

  @Test
  void parametersChangeTogetherOrNotAtAll() throws Exception {
    Program.assumeBuilt("rtpm-registryd", "rtpm-deviced");
    try (Laboratory laboratory = Laboratory.start(home);
        Node node = laboratory.node();
        Binding binding = node.bind("lab/arm0/config", ConfigurationMethods.INTERFACE)) {
      check(new ConfigurationClient(binding));
    }
  }

  private static void check(ConfigurationClient configuration) {
    ListReply list = Node.await(configuration.list());
    Parameter ramp =
        list.parameters().stream()
            .filter(one -> one.name().equals("safety.ramp_s"))
            .findAny()
            .orElseThrow();
    assertEquals("s", ramp.unit());
    long revision = list.revision();
    double middle = (ramp.low() + ramp.high()) / 2;
    assertEquals(OutcomeCode.OUT_OF_RANGE, apply(configuration, revision, ramp, ramp.high() + 1));
    assertEquals(OutcomeCode.DONE, apply(configuration, revision, ramp, middle));
    assertEquals(OutcomeCode.STALE_REVISION, apply(configuration, revision, ramp, ramp.low()));
  }

  private static OutcomeCode apply(
      ConfigurationClient configuration, long revision, Parameter parameter, double real) {
    Value value = new Value(parameter.type(), false, 0, real, null, null);
    List<Setting> settings = List.of(new Setting(parameter.name(), value));
    return Node.await(configuration.apply(new ApplyRequest(revision, settings)))
        .answer()
        .outcome();
  }
}

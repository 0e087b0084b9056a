package org.rtpm.vectors;

import static org.junit.jupiter.api.Assertions.assertNotNull;
import static org.junit.jupiter.api.Assertions.assertNull;

import java.util.ArrayList;
import java.util.List;
import java.util.stream.Stream;
import org.junit.jupiter.api.DynamicTest;
import org.junit.jupiter.api.TestFactory;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.ValueSource;

/** spec/vectors/conversations, without socket and clock. */
class ConversationTest {
  @TestFactory
  Stream<DynamicTest> bothSidesFollowTheVectors() {
    List<DynamicTest> tests = new ArrayList<>();
    for (String name : Player.names()) {
      Json conversation = Player.read(name);
      if (conversation.has("level")) {
        continue; // BindingTest plays those.
      }
      for (Json role : conversation.at("roles").list()) {
        tests.add(
            DynamicTest.dynamicTest(
                name + " as " + role.text(),
                () -> assertNull(Player.play(conversation, role.text()))));
      }
    }
    return tests.stream();
  }

  // A blind player would accept everything: each of these is a lie about the side.
  @ParameterizedTest
  @ValueSource(
      strings = {
        "lost-call",
        "large-request",
        "large-reply",
        "oneways",
        "cancelled-call",
        "stream",
        "several-calls",
        "server-stops"
      })
  void playerNoticesDeviations(String name) {
    Json conversation = Player.read(name);
    List<Json> steps = conversation.at("steps").list();
    for (String self : List.of("client", "server")) {
      for (int i = 0; i < steps.size(); ++i) {
        if (!Player.isOutput(steps.get(i), self)) {
          continue;
        }
        List<Json> missing = new ArrayList<>(steps);
        missing.remove(i);
        assertNotNull(Player.play(conversation, missing, self), self + " without step " + i);
        List<Json> twice = new ArrayList<>(steps);
        twice.add(i, steps.get(i));
        assertNotNull(Player.play(conversation, twice, self), self + " with step " + i + " twice");
      }
    }
  }
}

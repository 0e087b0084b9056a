package org.rtpm.vectors;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertNull;

import java.util.ArrayList;
import java.util.HashMap;
import java.util.HexFormat;
import java.util.List;
import java.util.Map;
import java.util.stream.Stream;
import org.junit.jupiter.api.DynamicTest;
import org.junit.jupiter.api.TestFactory;
import org.rtpm.internal.link.ChannelOfBand;
import org.rtpm.internal.link.LinkCall;
import org.rtpm.internal.link.LinkObject;
import org.rtpm.internal.link.Outcome;
import org.rtpm.internal.link.ServerLink;
import org.rtpm.internal.wire.Delivery;
import org.rtpm.internal.wire.FrameSink;
import org.rtpm.internal.wire.Limits;
import org.rtpm.internal.wire.Medium;

/** The conversations of clients that manage sessions and objects' numbers themselves. */
class BindingTest {
  /** A {@link ServerLink} that plays the client. */
  private static final class Link implements Side, ServerLink.Transport {
    private final ServerLink link;
    private final List<Output> outputs = new ArrayList<>();
    private LinkObject object;
    private ChannelOfBand last;

    Link(Json conversation) {
      Json setup = conversation.at("setup").at("client");
      link =
          new ServerLink(
              new ServerLink.Config(
                  Medium.DATAGRAM,
                  setup.at("epoch").number(),
                  () -> setup.at("channel").number(),
                  setup.at("clock_domain").number(),
                  setup.at("message_size_max").integer(),
                  () -> 17,
                  false,
                  null,
                  null,
                  null),
              this);
    }

    @Override
    public FrameSink connect(ChannelOfBand channel) {
      return frame -> {
        last = channel;
        outputs.add(Output.frame(frame));
      };
    }

    @Override
    public void disconnect(ChannelOfBand channel) {}

    private List<Output> taken() {
      List<Output> taken = new ArrayList<>(outputs);
      outputs.clear();
      return taken;
    }

    @Override
    public List<Output> receive(byte[] frame, boolean isForeign, long now) {
      link.onFrame(last, frame, now);
      return taken();
    }

    @Override
    public List<Output> act(Json step, FreeBytes free, long now) {
      if (step.at("client_does").text().equals("bind")) {
        Map<Integer, Integer> methods = new HashMap<>();
        for (Json method : step.at("methods").list()) {
          methods.put(method.at("id").integer(), method.at("fingerprint").integer());
        }
        object =
            new LinkObject(
                step.at("path").text(),
                step.at("interface").text(),
                step.at("fingerprint").number(),
                methods,
                "",
                step.at("priority").integer());
        LinkCall.Handler handler =
            outcome ->
                outputs.add(Output.words("client_sees", outcome.isOk() ? "bound" : "not_bound"));
        link.bind(object, now + Limits.SECOND, handler, now);
      } else {
        LinkCall.Handler handler = this::report;
        link.call(
            LinkCall.of(
                object,
                step.at("method").integer(),
                step.at("priority").integer(),
                step.at("trace_id").number(),
                now + Limits.SECOND,
                Delivery.REPLY,
                0,
                step.at("is_idempotent").flag(),
                step.at("payload").bytes(),
                handler),
            now);
      }
      return taken();
    }

    private void report(Outcome outcome) {
      if (outcome.cause() == Outcome.Cause.REPLIED) {
        outputs.add(
            Output.words(
                "client_sees",
                "result",
                "status",
                outcome.status().toString(),
                "payload",
                HexFormat.of().formatHex(outcome.payload())));
      } else {
        outputs.add(
            Output.words("client_sees", outcome.mayHaveRun() ? "may_have_run" : "not_run"));
      }
    }
  }

  @TestFactory
  Stream<DynamicTest> linksFollowTheVectors() {
    return Player.names().stream()
        .filter(name -> Player.read(name).has("level"))
        .map(
            name ->
                DynamicTest.dynamicTest(
                    name,
                    () -> {
                      Json conversation = Player.read(name);
                      assertEquals("bindings", conversation.at("level").text());
                      assertNull(
                          Player.play(
                              conversation,
                              conversation.at("steps").list(),
                              "client",
                              new Link(conversation)));
                    }));
  }
}

package org.rtpm.vectors;

import java.util.ArrayList;
import java.util.HashMap;
import java.util.HexFormat;
import java.util.List;
import java.util.Map;
import org.rtpm.Status;
import org.rtpm.internal.wire.CallParameters;
import org.rtpm.internal.wire.ClientChannel;
import org.rtpm.internal.wire.Delivery;
import org.rtpm.internal.wire.DropReason;
import org.rtpm.internal.wire.Medium;

/** A {@link ClientChannel} that plays the client of a conversation. */
final class ClientSide implements Side, ClientChannel.Listener {
  private record LostCall(int id, long epoch, long begun) {}

  private final Medium medium;
  private final ClientChannel channel;
  private final Map<Integer, ClientChannel.Call> calls = new HashMap<>();
  private final List<LostCall> lost = new ArrayList<>();
  private List<Output> outputs = new ArrayList<>();
  private long now;

  ClientSide(Json conversation) {
    Json setup = conversation.at("setup").at("client");
    medium = Medium.valueOf(conversation.at("medium").text().toUpperCase(java.util.Locale.ROOT));
    ClientChannel.Config config =
        new ClientChannel.Config(
            medium,
            setup.at("epoch").number(),
            setup.at("channel").number(),
            setup.at("clock_domain").number(),
            setup.at("message_size_max").integer(),
            8,
            77,
            Integer.MAX_VALUE);
    channel = new ClientChannel(config, frame -> outputs.add(Output.frame(frame)), this);
  }

  private List<Output> taken() {
    List<Output> taken = outputs;
    outputs = new ArrayList<>();
    return taken;
  }

  @Override
  public List<Output> receive(byte[] frame, boolean isForeign, long at) {
    now = at;
    long[] before = drops();
    channel.onFrame(frame, now);
    for (DropReason reason : DropReason.values()) {
      for (long i = before[reason.ordinal()]; i < channel.counters().dropped(reason); ++i) {
        outputs.add(Output.words("client_counts", reason.toString()));
      }
    }
    return taken();
  }

  private long[] drops() {
    long[] drops = new long[DropReason.values().length];
    for (DropReason reason : DropReason.values()) {
      drops[reason.ordinal()] = channel.counters().dropped(reason);
    }
    return drops;
  }

  @Override
  public List<Output> act(Json step, FreeBytes free, long at) {
    now = at;
    if (step.has("network_does")) {
      channel.reset();
      return taken();
    }
    switch (step.at("client_does").text()) {
      case "wait" -> {
        while (channel.nextTime() <= now) {
          channel.onTime(now);
        }
      }
      case "cancel" -> channel.cancel(callOf(step, free), now);
      case "take" -> take(callOf(step, free));
      case "close" -> channel.close(now);
      case "open" ->
          channel.open(step.at("priority").integer(), step.at("deadline_ns").number(), now);
      case "call" -> call(step);
      default -> throw new AssertionError("unknown step " + step);
    }
    return taken();
  }

  private ClientChannel.Call callOf(Json step, FreeBytes free) {
    return calls.get((int) free.number(step.at("call_id")));
  }

  private void take(ClientChannel.Call call) {
    for (byte[] item; (item = channel.nextItem(call)) != null; ) {
      outputs.add(
          Output.words("client_sees", "item", "call_id", id(call), "payload", hex(item)));
    }
    channel.flush(now);
  }

  private void call(Json step) {
    Delivery delivery =
        switch (step.text("delivery", "reply")) {
          case "receipt" -> Delivery.RECEIPT;
          case "sent" -> Delivery.SENT;
          default -> Delivery.REPLY;
        };
    int service = step.at("service").integer();
    int method = step.at("method").integer();
    int priority = step.at("priority").integer();
    long trace = step.at("trace_id").number();
    long deadline = step.at("deadline_ns").number();
    int window = (int) step.number("window", 0);
    CallParameters parameters =
        window > 0
            ? CallParameters.stream(service, method, priority, trace, deadline, window, 0)
            : CallParameters.call(service, method, priority, trace, deadline, delivery);
    ClientChannel.Call call = channel.call(parameters, step.at("payload").bytes(), now);
    if (call == null) {
      outputs.add(
          Output.words(
              "client_sees",
              channel.notBegun().toString().toLowerCase(java.util.Locale.ROOT)));
      return;
    }
    for (ClientChannel.Call other : calls.values()) {
      if (other.isOpen() && (call.id() - other.id()) % channel.welcome().window() == 0) {
        throw new AssertionError("hp-4.3-2: the place of an open call is taken");
      }
    }
    calls.put(call.id(), call);
  }

  private static String id(ClientChannel.Call call) {
    return Integer.toUnsignedString(call.id());
  }

  private static String hex(byte[] bytes) {
    return HexFormat.of().formatHex(bytes);
  }

  @Override
  public void onReady() {
    outputs.add(Output.words("client_sees", "ready"));
    for (LostCall call : lost) {
      boolean isSafe =
          ClientChannel.hasNotRun(
              call.epoch, channel.welcome().serverEpoch(), call.begun, now);
      outputs.add(
          Output.words(
              "client_sees",
              isSafe ? "not_run" : "may_have_run",
              "call_id",
              Integer.toUnsignedString(call.id)));
    }
    lost.clear();
  }

  @Override
  public void onRefused(Status status) {
    outputs.add(Output.words("client_sees", "refused", "status", status.toString()));
  }

  @Override
  public void onOpenTimeout() {
    outputs.add(Output.words("client_sees", "timeout"));
  }

  @Override
  public void onReply(ClientChannel.Call call, Status status, byte[] payload) {
    outputs.add(
        Output.words(
            "client_sees",
            "result",
            "call_id",
            id(call),
            "status",
            status.toString(),
            "payload",
            hex(payload)));
  }

  @Override
  public void onItems(ClientChannel.Call call) {
    // The application takes them when the vector says so.
  }

  @Override
  public void onTimeout(ClientChannel.Call call) {
    outputs.add(Output.words("client_sees", "timeout", "call_id", id(call)));
  }

  @Override
  public void onLost(List<ClientChannel.Call> open) {
    outputs.add(Output.words("client_sees", "lost"));
    for (ClientChannel.Call call : open) {
      lost.add(new LostCall(call.id(), channel.welcome().serverEpoch(), call.begun()));
    }
  }

  @Override
  public void onClosed(List<ClientChannel.Call> open) {
    outputs.add(Output.words("client_sees", "closed"));
  }

  @Override
  public void onBroken(List<ClientChannel.Call> open) {
    outputs.add(Output.words("client_sees", "broken"));
  }
}

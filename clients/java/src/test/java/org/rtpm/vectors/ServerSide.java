package org.rtpm.vectors;

import java.util.ArrayList;
import java.util.HashMap;
import java.util.HexFormat;
import java.util.List;
import java.util.Locale;
import java.util.Map;
import org.rtpm.Status;
import org.rtpm.internal.wire.DropReason;
import org.rtpm.internal.wire.Medium;
import org.rtpm.internal.wire.Peer;
import org.rtpm.internal.wire.ServerSessions;
import org.rtpm.internal.wire.SipHash;

/** The lanes' {@link ServerSessions} that play the server of a conversation. */
final class ServerSide implements Side, ServerSessions.Handler {
  private final Json setup;
  private final Medium medium;
  private final Lanes lanes = new Lanes();
  private final Map<Integer, RunningCall> running = new HashMap<>();
  private List<Output> outputs = new ArrayList<>();
  private ServerSessions current;
  private long epoch;
  private long connection = 1;
  private long life;
  private long now;

  ServerSide(Json conversation) {
    setup = conversation.at("setup").at("server");
    medium = Medium.valueOf(conversation.at("medium").text().toUpperCase(Locale.ROOT));
    epoch = setup.at("epoch").number();
    start();
  }

  private void start() {
    lanes.clear();
    running.clear();
    List<Json> bands = setup.has("bands") ? setup.at("bands").list() : List.of(setup.at("band"));
    SipHash key = new SipHash(++life, 2);
    for (Json band : bands) {
      int low = band.list().get(0).integer();
      int high = band.list().get(1).integer();
      ServerSessions.Config config =
          new ServerSessions.Config(
              medium,
              low,
              high,
              setup.at("ceiling").integer(),
              epoch,
              setup.at("clock_domain").number(),
              key,
              lanes.count(),
              bands.size(),
              setup.at("session_count_max").integer(),
              setup.at("message_size_max").integer(),
              (int) setup.number("large_message_count_max", 3),
              4,
              Integer.MAX_VALUE);
      lanes.add(
          low,
          high,
          new ServerSessions(config, (peer, frame) -> outputs.add(Output.frame(frame)), this));
    }
  }

  private List<Output> taken() {
    List<Output> taken = outputs;
    outputs = new ArrayList<>();
    return taken;
  }

  @Override
  public List<Output> receive(byte[] frame, boolean isForeign, long at) {
    now = at;
    current = lanes.of(frame);
    long[] before = drops();
    boolean isGood = current.onFrame(frame, Peer.of(0, connection, isForeign ? 2 : 1), now);
    for (DropReason reason : DropReason.values()) {
      for (long i = before[reason.ordinal()]; i < current.counters().dropped(reason); ++i) {
        outputs.add(Output.words("server_counts", reason.toString()));
      }
    }
    if (!isGood) {
      outputs.add(Output.words("server_sees", "hang_up"));
    }
    return taken();
  }

  private long[] drops() {
    long[] drops = new long[DropReason.values().length];
    for (DropReason reason : DropReason.values()) {
      drops[reason.ordinal()] = current.counters().dropped(reason);
    }
    return drops;
  }

  @Override
  public List<Output> act(Json step, FreeBytes free, long at) {
    now = at;
    if (step.has("network_does")) {
      lanes.all().forEach(sessions -> sessions.endConnection(Peer.of(0, connection, 1)));
      ++connection;
      return taken();
    }
    switch (step.at("server_does").text()) {
      case "restart" -> {
        epoch = step.at("epoch").number();
        start();
      }
      case "wait" -> lanes.all().forEach(sessions -> sessions.onTime(now));
      case "stop" -> lanes.all().forEach(sessions -> sessions.closeAll(now));
      default -> actOnCall(step, free);
    }
    return taken();
  }

  private void actOnCall(Json step, FreeBytes free) {
    int id = (int) free.number(step.at("call_id"));
    RunningCall call = running.get(id);
    if (call == null) {
      throw new AssertionError("this call does not run: " + step);
    }
    switch (step.at("server_does").text()) {
      case "receipt" -> call.sessions().accept(call.request(), status(step), now);
      case "item" -> {
        String refusal = call.push(step.at("payload").bytes(), now);
        if (refusal != null) {
          outputs.add(sees(refusal, id));
        }
      }
      case "complete" -> {
        running.remove(id);
        byte[] payload = step.at("payload").bytes();
        call.sessions().complete(call.request(), status(step), payload, now);
      }
      default -> throw new AssertionError("unknown step " + step);
    }
  }

  private static Status status(Json step) {
    return Status.valueOf(step.at("status").text().toUpperCase(Locale.ROOT));
  }

  private static Output sees(String what, int id) {
    return Output.words("server_sees", what, "call_id", Integer.toUnsignedString(id));
  }

  @Override
  public void onCall(ServerSessions.Request request) {
    running.put(request.callId(), new RunningCall(request, current));
    outputs.add(
        Output.words(
            "server_sees",
            "run",
            "call_id",
            Integer.toUnsignedString(request.callId()),
            "service",
            Integer.toString(request.service()),
            "method",
            Integer.toString(request.method()),
            "payload",
            HexFormat.of().formatHex(request.payload()),
            "deadline_ns",
            Long.toString(request.deadline())));
  }

  @Override
  public void onCancelled(ServerSessions.Request request) {
    outputs.add(sees("cancelled", request.callId()));
  }

  @Override
  public void onCredit(ServerSessions.Request request) {
    RunningCall call = running.get(request.callId());
    if (call != null) {
      call.onCredit(now);
    }
  }
}

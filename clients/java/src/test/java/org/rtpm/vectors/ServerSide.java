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
  private record Lane(int low, int high, ServerSessions sessions) {}

  private static final class Running {
    final ServerSessions.Request request;
    final ServerSessions sessions;
    byte[] item;

    Running(ServerSessions.Request request, ServerSessions sessions) {
      this.request = request;
      this.sessions = sessions;
    }
  }

  private final Json setup;
  private final Medium medium;
  private final List<Lane> lanes = new ArrayList<>();
  private final Map<Integer, Running> running = new HashMap<>();
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
              lanes.size(),
              bands.size(),
              setup.at("session_count_max").integer(),
              setup.at("message_size_max").integer(),
              (int) setup.number("large_message_count_max", 3),
              4,
              Integer.MAX_VALUE);
      lanes.add(
          new Lane(
              low,
              high,
              new ServerSessions(
                  config, (peer, frame) -> outputs.add(Output.frame(frame)), this)));
    }
  }

  private List<Output> taken() {
    List<Output> taken = outputs;
    outputs = new ArrayList<>();
    return taken;
  }

  // hp-11-2: the frame's priority chooses the lane, wherever its session is.
  private ServerSessions laneOf(byte[] frame) {
    if (frame.length >= 64) {
      int priority = (frame[4] & 0xff) | (frame[5] & 0xff) << 8;
      for (Lane lane : lanes) {
        if (lane.low <= priority && priority <= lane.high) {
          return lane.sessions;
        }
      }
    }
    return lanes.get(0).sessions;
  }

  @Override
  public List<Output> receive(byte[] frame, boolean isForeign, long at) {
    now = at;
    current = laneOf(frame);
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
      for (Lane lane : lanes) {
        lane.sessions.endConnection(Peer.of(0, connection, 1));
      }
      ++connection;
      return taken();
    }
    switch (step.at("server_does").text()) {
      case "restart" -> {
        epoch = step.at("epoch").number();
        start();
      }
      case "wait" -> lanes.forEach(lane -> lane.sessions.onTime(now));
      case "stop" -> lanes.forEach(lane -> lane.sessions.closeAll(now));
      default -> actOnCall(step, free);
    }
    return taken();
  }

  private void actOnCall(Json step, FreeBytes free) {
    int id = (int) free.number(step.at("call_id"));
    Running call = running.get(id);
    if (call == null) {
      throw new AssertionError("this call does not run: " + step);
    }
    ServerSessions.Request request = call.request;
    switch (step.at("server_does").text()) {
      case "receipt" -> call.sessions.accept(request, status(step), now);
      case "item" -> {
        byte[] item = step.at("payload").bytes();
        int max = call.sessions.itemSizeMax(request);
        if (max > 0 && item.length > max) {
          outputs.add(sees("item_too_large", id));
        } else if (call.sessions.pushItem(request, item, now)) {
          call.item = call.sessions.isItemMidway(request) ? item : null;
        } else {
          outputs.add(sees("no_credit", id));
        }
      }
      case "complete" -> {
        running.remove(id);
        call.sessions.complete(request, status(step), step.at("payload").bytes(), now);
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
    running.put(request.callId(), new Running(request, current));
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
    Running call = running.get(request.callId());
    if (call != null && call.item != null && call.sessions.pushItem(request, call.item, now)) {
      call.item = call.sessions.isItemMidway(request) ? call.item : null;
    }
  }
}

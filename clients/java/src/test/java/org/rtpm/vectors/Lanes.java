package org.rtpm.vectors;

import java.util.ArrayList;
import java.util.List;
import org.rtpm.internal.wire.Limits;
import org.rtpm.internal.wire.ServerSessions;

/** The lanes of a server under test, each with its own band and sessions. */
public final class Lanes {
  private record Lane(int low, int high, ServerSessions sessions) {}

  private final List<Lane> lanes = new ArrayList<>();

  public void add(int low, int high, ServerSessions sessions) {
    lanes.add(new Lane(low, high, sessions));
  }

  public void clear() {
    lanes.clear();
  }

  public int count() {
    return lanes.size();
  }

  public List<ServerSessions> all() {
    return lanes.stream().map(Lane::sessions).toList();
  }

  /** hp-11-2: the frame's priority chooses the lane, wherever its session is. */
  public ServerSessions of(byte[] frame) {
    if (frame.length >= Limits.HEADER_SIZE) {
      int priority = (frame[4] & 0xff) | (frame[5] & 0xff) << 8;
      for (Lane lane : lanes) {
        if (lane.low <= priority && priority <= lane.high) {
          return lane.sessions;
        }
      }
    }
    return lanes.get(0).sessions;
  }
}

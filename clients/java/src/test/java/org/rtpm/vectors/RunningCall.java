package org.rtpm.vectors;

import org.rtpm.internal.wire.ServerSessions;

/** A call that a server under test runs, and the item of its stream that is on its way. */
public final class RunningCall {
  private final ServerSessions.Request request;
  private final ServerSessions sessions;
  /** Its first bytes are sent, and the rest waits for credit. */
  private byte[] item;

  public RunningCall(ServerSessions.Request request, ServerSessions sessions) {
    this.request = request;
    this.sessions = sessions;
  }

  public ServerSessions.Request request() {
    return request;
  }

  public ServerSessions sessions() {
    return sessions;
  }

  /** Gives an item; why it was not taken, in the words of the conversations, else null. */
  public String push(byte[] given, long now) {
    int max = sessions.itemSizeMax(request);
    if (max > 0 && given.length > max) {
      return "item_too_large";
    }
    if (!sessions.pushItem(request, given, now)) {
      return "no_credit";
    }
    item = sessions.isItemMidway(request) ? given : null;
    return null;
  }

  /** Goes on with the item that waits. */
  public void onCredit(long now) {
    if (item != null && sessions.pushItem(request, item, now)) {
      item = sessions.isItemMidway(request) ? item : null;
    }
  }
}

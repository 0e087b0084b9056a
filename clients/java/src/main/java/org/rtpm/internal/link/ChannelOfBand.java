package org.rtpm.internal.link;

import java.util.ArrayDeque;
import java.util.ArrayList;
import java.util.Deque;
import java.util.List;
import org.rtpm.Status;
import org.rtpm.internal.sealed.SealedClient;
import org.rtpm.internal.wire.ClientChannel;
import org.rtpm.internal.wire.Limits;

/** A link's channel to one band of the server's priorities: one socket, one session at a time. */
public final class ChannelOfBand implements ClientChannel.Listener {
  /** For the transport. */
  public Object attachment;

  final ServerLink link;
  /** A priority of the band. */
  int priority;
  ClientChannel channel;
  SealedClient sealed;
  boolean hasWelcome;
  final Deque<LinkCall> queue = new ArrayDeque<>();
  /** Calls of a lost session, until the next one is open (hp-5.5-3). */
  final List<LinkCall> lost = new ArrayList<>();
  /** Calls that are open, or streams with items left. */
  final List<LinkCall> open = new ArrayList<>();
  long lastUsed;

  ChannelOfBand(ServerLink link, int priority) {
    this.link = link;
    this.priority = priority;
  }

  /** The link whose channel it is. */
  public ServerLink link() {
    return link;
  }

  boolean isReady() {
    return channel.isReady();
  }

  boolean serves(int wanted) {
    return hasWelcome ? channel.welcome().serves(wanted) : wanted == priority;
  }

  boolean isIdle() {
    return queue.isEmpty() && lost.isEmpty() && open.isEmpty();
  }

  void settle(long now) {
    if (sealed != null) {
      sealed.settle(now);
    }
  }

  private static LinkCall of(ClientChannel.Call call) {
    return (LinkCall) call.attachment;
  }

  private List<LinkCall> taken(List<ClientChannel.Call> calls) {
    List<LinkCall> taken = new ArrayList<>();
    for (ClientChannel.Call call : calls) {
      taken.add(of(call));
    }
    open.removeAll(taken);
    return taken;
  }

  @Override
  public void onReady() {
    hasWelcome = true;
    link.onReady(this);
  }

  @Override
  public void onRefused(Status status) {
    link.onUnopened(this, new Outcome(Outcome.Cause.REFUSED, status, new byte[0], false));
  }

  @Override
  public void onOpenTimeout() {
    link.onUnopened(this, Outcome.failed(Outcome.Cause.UNREACHABLE, false));
  }

  @Override
  public void onReply(ClientChannel.Call call, Status status, byte[] payload) {
    LinkCall ended = of(call);
    if (!call.isOpen()) {
      open.remove(ended);
    }
    link.end(ended, ended.outcome(status, payload));
    link.pump(this);
  }

  @Override
  public void onItems(ClientChannel.Call call) {
    of(call).handler.onItems();
  }

  @Override
  public void onTimeout(ClientChannel.Call call) {
    open.remove(of(call));
    link.end(of(call), Outcome.failed(Outcome.Cause.DEADLINE, true));
    link.pump(this);
  }

  @Override
  public void onLost(List<ClientChannel.Call> calls) {
    lost.addAll(taken(calls));
    link.openSession(this);
  }

  @Override
  public void onClosed(List<ClientChannel.Call> calls) {
    link.onEndOfSession(this, taken(calls), Outcome.Cause.CLOSED);
  }

  @Override
  public void onBroken(List<ClientChannel.Call> calls) {
    link.transport.disconnect(this);
    link.onEndOfSession(this, taken(calls), Outcome.Cause.LOST);
  }

  long nextTime() {
    long next = channel.nextTime();
    // Most of the time both are empty, and an iterator is garbage.
    if (!queue.isEmpty() || !lost.isEmpty()) {
      for (LinkCall call : queue) {
        next = Math.min(next, call.deadline);
      }
      for (LinkCall call : lost) {
        next = Math.min(next, call.deadline);
      }
    }
    // hp-4.6-1
    return channel.isReady() ? Math.min(next, lastUsed + ServerLink.PING_INTERVAL) : next;
  }

  /** Which calls wait longer than they may. */
  List<LinkCall> takeExpired(long now) {
    List<LinkCall> expired = new ArrayList<>();
    for (LinkCall call : queue) {
      if (call.deadline <= now) {
        expired.add(call);
      }
    }
    for (LinkCall call : lost) {
      if (call.deadline <= now) {
        expired.add(call);
      }
    }
    queue.removeAll(expired);
    lost.removeAll(expired);
    return expired;
  }

  long latestDeadline() {
    long latest = Long.MIN_VALUE;
    for (LinkCall call : queue) {
      latest = Math.max(latest, call.deadline);
    }
    for (LinkCall call : lost) {
      latest = Math.max(latest, call.deadline);
    }
    return latest == Long.MIN_VALUE ? Limits.NEVER : latest;
  }
}

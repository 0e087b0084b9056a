package org.rtpm.internal.link;

import java.util.ArrayList;
import java.util.List;
import java.util.Map;
import org.rtpm.internal.wire.BindReply;

/** An object of a server, as one binding of this program uses it. */
public final class LinkObject {
  final String path;
  final String interfaceName;
  final long fingerprint;
  /** The fingerprints of the methods that this program knows, by their numbers. */
  final Map<Integer, Integer> methods;
  final String text;
  final int priority;
  /** Calls that wait for the bind. */
  final List<LinkCall> waiting = new ArrayList<>();
  boolean isBinding;
  /** The server's epoch in which {@link #bound} holds; 0: not bound. */
  long epoch;
  BindReply bound;

  /**
   * An object that is not bound yet.
   *
   * @param fingerprint of this program's view of the interface; 0: unknown
   * @param text of the interface (hp-12.2); may be empty
   * @param priority at which it is bound
   */
  public LinkObject(
      String path,
      String interfaceName,
      long fingerprint,
      Map<Integer, Integer> methods,
      String text,
      int priority) {
    this.path = path;
    this.interfaceName = interfaceName;
    this.fingerprint = fingerprint;
    this.methods = methods;
    this.text = text;
    this.priority = priority;
  }

  // hp-6.1-3
  int priorityFor(int wanted) {
    if (bound == null) {
      return wanted < 0 ? priority : wanted;
    }
    return bound.isServerDeclared() || wanted < 0 ? bound.priority() : wanted;
  }

  /** The object's number at its server; 0: not bound. */
  public int service() {
    return bound == null ? 0 : bound.service();
  }

  // hp-6.1-2, hp-6.1-6
  boolean understands(BindReply reply) {
    if (fingerprint != 0 && fingerprint == reply.fingerprint()) {
      return true;
    }
    for (Map.Entry<Integer, Integer> ours : methods.entrySet()) {
      Integer theirs = reply.methods().get(ours.getKey());
      if (theirs == null ? reply.isMethodListComplete() : !theirs.equals(ours.getValue())) {
        return false;
      }
    }
    return true;
  }
}

package org.rtpm.internal.serve;

import java.util.LinkedHashMap;
import java.util.Map;
import org.rtpm.internal.wire.BindReply;
import org.rtpm.values.Interface;
import org.rtpm.values.Method;
import org.rtpm.values.PriorityModel;
import org.rtpm.values.Skeleton;

/** An object that a server serves. Immutable. */
final class ServedObject {
  /** The priority of objects whose schema states none. */
  private static final int PRIORITY_DEFAULT = 16_000;

  final String path;
  final Skeleton skeleton;
  final boolean isServerDeclared;
  final int priority;
  /** The answer to a bind. */
  final byte[] bindReply;

  ServedObject(String path, int service, Skeleton skeleton) {
    this.path = path;
    this.skeleton = skeleton;
    Interface description = skeleton.description();
    isServerDeclared = description.priorityModel() == PriorityModel.SERVER_DECLARED;
    priority = description.priority() < 0 ? PRIORITY_DEFAULT : description.priority();
    Map<Integer, Integer> methods = new LinkedHashMap<>();
    for (Method<?, ?> method : description.methods()) {
      methods.put((int) method.id(), (int) method.fingerprint());
    }
    bindReply =
        new BindReply(
                service, priority, isServerDeclared, true, description.fingerprint(), methods)
            .payload();
  }
}

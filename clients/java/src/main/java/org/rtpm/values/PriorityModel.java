package org.rtpm.values;

/** Which side decides the priority at which an object's methods run (hp-6.1-3). */
public enum PriorityModel {
  /** The caller's priority; the interface's if the caller states none. */
  CLIENT_PROPAGATED,
  /** The interface's priority, regardless of the caller's. */
  SERVER_DECLARED
}

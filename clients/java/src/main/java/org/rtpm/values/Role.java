package org.rtpm.values;

/** The role that a caller needs; each includes the previous ones (spec/hprotocol.md, 6.4). */
public enum Role {
  /** Reads state. */
  OBSERVE,
  /** Commands devices; the role of methods that state none. */
  COMMAND,
  /** Changes configurations. */
  CONFIGURE,
  /** Administers the server. */
  ADMINISTER
}

package org.rtpm;

/** How frames go to a server. */
public enum Transport {
  /** Datagrams: the smallest delay, and a lost frame delays only its own call. */
  UDP,
  /** A connection: for large messages, and where networks let no datagrams through. */
  TCP
}

package org.rtpm.values;

/** How a method is called (spec/hprotocol.md, 5.8 and 5.10). */
public enum Kind {
  /** The caller gets a reply. Includes {@code rtpm_oneway: "done"}, whose reply is empty. */
  CALL,
  /** {@code rtpm_oneway: "sent"}: flag <em>no reply</em>; the request fits one frame. */
  ONEWAY,
  /**
   * {@code rtpm_oneway: "received"}: flag <em>reply on receipt</em>; the call ends when the server
   * is about to run it.
   */
  RECEIPT,
  /** The caller gets any number of items, then the end. */
  STREAM
}

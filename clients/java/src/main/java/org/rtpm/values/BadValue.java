package org.rtpm.values;

/**
 * Bytes that are no value of their type, or a value that its type cannot encode.
 *
 * <p>A server answers {@code bad_request} to a request that decodes with it; a client takes the
 * reply for malformed. The message names the place and the reason, without bytes of the peer.
 */
public final class BadValue extends RuntimeException {
  private static final long serialVersionUID = 1L;

  /**
   * Creates the exception.
   *
   * @param reason a sentence without foreign text
   */
  public BadValue(String reason) {
    super(reason, null, false, false);
  }
}

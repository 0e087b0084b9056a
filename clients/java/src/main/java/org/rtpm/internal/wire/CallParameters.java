package org.rtpm.internal.wire;

/**
 * The parameters of a call besides its payload. Times are in nanoseconds.
 *
 * @param streamWindow how many items of a stream the client takes at a time, up to 32; 0 if it is
 *     no stream
 * @param byteWindow how many bytes of a stream it takes at a time, at least what the medium lets a
 *     server send before the first CREDIT
 * @param streamSilence how long a stream's client keeps asking without an answer
 * @param streamLease how long the server keeps a stream without hearing of its client
 */
public record CallParameters(
    int service,
    int method,
    int priority,
    long traceId,
    long deadline,
    Delivery delivery,
    int streamWindow,
    int byteWindow,
    long streamSilence,
    long streamLease) {

  /** A call that is no stream. */
  public static CallParameters call(
      int service, int method, int priority, long traceId, long deadline, Delivery delivery) {
    return new CallParameters(
        service, method, priority, traceId, deadline, delivery, 0, 0, 0, 0);
  }

  /** A stream with RTPM's usual silence and lease. */
  public static CallParameters stream(
      int service, int method, int priority, long traceId, long deadline, int window,
      int byteWindow) {
    return new CallParameters(
        service,
        method,
        priority,
        traceId,
        deadline,
        Delivery.REPLY,
        window,
        byteWindow,
        Limits.STREAM_SILENCE,
        Limits.STREAM_LEASE);
  }
}

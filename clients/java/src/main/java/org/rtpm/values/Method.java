package org.rtpm.values;

import java.time.Duration;
import java.util.Objects;

/**
 * One operation of an interface, as generated code describes it.
 *
 * @param <Q> the request's type; {@link Void} for none
 * @param <R> the type of the reply, or of a stream's items; {@link Void} for none
 * @param name the name in the schema, also where Java's differs
 * @param id {@code rtpm_id}, 1 to 65535
 * @param kind how it is called
 * @param request the request's codec; decoding also checks the request's ranges
 * @param reply the codec of the reply or of an item
 * @param fingerprint 32 bits, unsigned, of everything that both sides must agree on (hp-12.1); 0 if
 *     unknown
 * @param isIdempotent running it twice does no harm, so a client may repeat it at a new server
 * @param deadline the caller's default deadline; zero for the node's
 * @param role the role that a caller needs
 * @param maxSize the largest request, reply or item in bytes; 0 for the session's limit
 */
public record Method<Q, R>(
    String name,
    long id,
    Kind kind,
    Codec<Q> request,
    Codec<R> reply,
    long fingerprint,
    boolean isIdempotent,
    Duration deadline,
    Role role,
    int maxSize) {
  /** Checks the components. */
  public Method {
    if (id < 1 || id > 65535) {
      throw new IllegalArgumentException("method " + name + ": id " + id + " is not 1 to 65535");
    }
    Objects.requireNonNull(kind);
    Objects.requireNonNull(request);
    Objects.requireNonNull(reply);
    Objects.requireNonNull(deadline);
    Objects.requireNonNull(role);
  }

  /** Whether a request, reply or item of so many bytes is more than the schema allows. */
  public boolean isTooLarge(int size) {
    return maxSize > 0 && size > maxSize;
  }

  /** A method without fingerprint and without attributes of its own. */
  public Method(String name, long id, Kind kind, Codec<Q> request, Codec<R> reply) {
    this(name, id, kind, request, reply, 0, false, Duration.ZERO, Role.COMMAND, 0);
  }
}

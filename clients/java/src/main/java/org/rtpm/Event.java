package org.rtpm;

import java.nio.ByteBuffer;
import org.rtpm.values.BadValue;
import org.rtpm.values.EventType;

/**
 * An event, as a hub delivers it (spec/events.md, section 2). Times are on the hub's monotonic
 * clock.
 *
 * @param type 1 to 2^31-1; larger ones, negative here, are the hub's own
 * @param source tells the suppliers of one type apart
 * @param sequence counts the events of one supplier, type and source, from 1; 0: not counted
 * @param originNs when it happened
 * @param receivedNs when the hub took it up
 * @param sentNs when the hub sent it on
 * @param schemaId of the payload; 0: none
 * @param uncertaintyNs how far originNs may be off; 2^32-1: unknown
 * @param priority the supplier's
 * @param isReplayed it is older than the subscription
 * @param isJoined the next event belongs to the same delivery, as a filter correlated them
 * @param payload not to be changed
 */
public record Event(
    int type,
    int source,
    long sequence,
    long originNs,
    long receivedNs,
    long sentNs,
    long schemaId,
    long uncertaintyNs,
    int priority,
    boolean isReplayed,
    boolean isJoined,
    byte[] payload) {

  /**
   * The event's value.
   *
   * @throws BadValue if the event has another type or schema, or is malformed
   */
  public <T> T value(EventType<T> of) {
    if (type != of.type() || schemaId != of.schemaId()) {
      throw new BadValue("an event of another type or schema than " + of.name());
    }
    return of.codec().decode(ByteBuffer.wrap(payload));
  }

  /** Whether the event has this type and schema. */
  public boolean is(EventType<?> of) {
    return type == of.type() && schemaId == of.schemaId();
  }
}

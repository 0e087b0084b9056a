package org.rtpm.values;

import java.util.List;

/**
 * A number in an event's payload, as a hub's {@code FieldEntry} states it.
 *
 * @param name with dots through structs and tables: "pose.position_m.x"
 * @param type bool, int8, uint8, int16, uint16, int32, uint32, int64, uint64, float, double,
 *     counted from 0
 * @param slots the slots of nested tables, at most 4; empty if the payload is the bare struct
 * @param offset the offset in the last slot's struct, in bytes
 * @param defaultValue Double for a float or double, else Long (64 bits; unsigned for bool and
 *     unsigned types); null without slots
 */
public record EventField(
    String name, int type, List<Integer> slots, int offset, Number defaultValue) {
  /** Copies the components. */
  public EventField {
    slots = List.copyOf(slots);
  }
}

package org.rtpm.values;

import java.util.List;

/**
 * A table with {@code rtpm_event}, as generated code describes it (spec/events.md, 2).
 *
 * @param <T> the payload's type
 * @param name with its namespace, "lab.Touched"
 * @param type {@code rtpm_event}, 1 to 2147483647
 * @param schemaId fingerprint of the payload's schema, 64 bits, unsigned
 * @param codec the payload's codec
 * @param fields the numbers that filters can read
 * @param schema a schema without includes whose root type is the event; may be empty
 */
public record EventType<T>(
    String name,
    int type,
    long schemaId,
    Codec<T> codec,
    List<EventField> fields,
    String schema) {
  /** Copies the components. */
  public EventType {
    fields = List.copyOf(fields);
  }
}

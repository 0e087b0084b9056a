package org.rtpm;

import java.util.ArrayList;
import java.util.List;
import java.util.Set;
import org.rtpm.values.EventField;
import org.rtpm.values.EventType;
import rtpm.events.FieldEntry;
import rtpm.events.FilterNode;
import rtpm.events.NodeKind;
import rtpm.events.Number;
import rtpm.events.NumberKind;
import rtpm.events.TypeEntry;

/** Which events a consumer gets; the hub evaluates it. Immutable. */
public final class EventFilter {
  /** How a field is compared; the ordinals are the wire's. */
  public enum Comparison {
    /** Equal. */
    EQUAL,
    /** Not equal. */
    NOT_EQUAL,
    /** Less. */
    LESS,
    /** Less or equal. */
    LESS_OR_EQUAL,
    /** Greater. */
    GREATER,
    /** Greater or equal. */
    GREATER_OR_EQUAL,
    /** A bit of the operand is set; of whole numbers. */
    ANY_BIT
  }

  private static final long ALL_BITS = 0xffff_ffffL;
  /** The numbers of bool and the unsigned types in EventField. */
  private static final Set<Integer> UNSIGNED = Set.of(0, 2, 4, 6, 8);

  private final FilterNode node;
  /** The types whose fields it names, or which its consumer knows. */
  private final List<EventType<?>> types;

  private EventFilter(FilterNode node, List<EventType<?>> types) {
    this.node = node;
    this.types = List.copyOf(types);
  }

  /** All events. */
  public static EventFilter everything() {
    return new EventFilter(FilterNode.builder().kind(NodeKind.EVERYTHING).build(), List.of());
  }

  /** The events of a type, of all sources. */
  public static EventFilter of(EventType<?> type) {
    return new EventFilter(
        FilterNode.builder()
            .kind(NodeKind.MATCH)
            .type(type.type())
            .typeMask(ALL_BITS)
            .build(),
        List.of(type));
  }

  /** The events of a type, of one source. */
  public static EventFilter of(EventType<?> type, int source) {
    return new EventFilter(
        FilterNode.builder()
            .kind(NodeKind.MATCH)
            .type(type.type())
            .typeMask(ALL_BITS)
            .source(Integer.toUnsignedLong(source))
            .sourceMask(ALL_BITS)
            .build(),
        List.of(type));
  }

  /**
   * The events of a type in which a number agrees.
   *
   * @param field with dots, such as {@code force_newton.z}
   * @throws IllegalArgumentException if the type has no such number
   */
  public static EventFilter where(
      EventType<?> type, String field, Comparison comparison, double operand) {
    if (type.fields().stream().noneMatch(each -> each.name().equals(field))) {
      throw new IllegalArgumentException(
          type.name() + " has no number " + Printable.of(field) + ", but "
              + type.fields().stream().map(EventField::name).toList());
    }
    return new EventFilter(
        FilterNode.builder()
            .kind(NodeKind.WHERE)
            .type(type.type())
            .field(field)
            .comparison(comparison.ordinal())
            .operand(numberOf(operand))
            .build(),
        List.of(type));
  }

  /** The events that any of the filters accepts. */
  public static EventFilter any(EventFilter... filters) {
    return group(NodeKind.ANY, filters);
  }

  /** The events that all of the filters accept. */
  public static EventFilter all(EventFilter... filters) {
    return group(NodeKind.ALL, filters);
  }

  /** The events that the filter does not accept. */
  public static EventFilter not(EventFilter filter) {
    return group(NodeKind.NOT, filter);
  }

  private static EventFilter group(NodeKind kind, EventFilter... filters) {
    List<FilterNode> children = new ArrayList<>();
    List<EventType<?>> types = new ArrayList<>();
    for (EventFilter each : filters) {
      children.add(each.node);
      types.addAll(each.types);
    }
    return new EventFilter(
        FilterNode.builder().kind(kind).children(children).build(),
        types.stream().distinct().toList());
  }

  FilterNode node() {
    return node;
  }

  List<TypeEntry> typeEntries() {
    return types.stream().<TypeEntry>map(EventFilter::entryOf).toList();
  }

  static TypeEntry entryOf(EventType<?> type) {
    List<FieldEntry> fields = new ArrayList<>();
    for (EventField field : type.fields()) {
      fields.add(
          new FieldEntry(
              field.name(),
              field.type(),
              field.slots().stream().mapToInt(Integer::intValue).toArray(),
              field.offset(),
              defaultOf(field)));
    }
    return new TypeEntry(type.type(), type.name(), type.schemaId(), fields, type.schema());
  }

  private static Number defaultOf(EventField field) {
    if (field.defaultValue() == null) {
      return null;
    }
    if (field.defaultValue() instanceof Double real) {
      return new Number(0, 0, real, NumberKind.REAL);
    }
    long whole = field.defaultValue().longValue();
    return UNSIGNED.contains(field.type())
        ? new Number(0, whole, 0, NumberKind.UNSIGNED)
        : new Number(whole, 0, 0, NumberKind.SIGNED);
  }

  private static Number numberOf(double value) {
    boolean isWhole = value == Math.rint(value) && Math.abs(value) < 1L << 53;
    return isWhole
        ? new Number((long) value, 0, 0, NumberKind.SIGNED)
        : new Number(0, 0, value, NumberKind.REAL);
  }
}

import {
  FieldEntry,
  FilterNode,
  NodeKind,
  NumberKind,
  TypeEntry,
  type Number as HubNumber,
} from "../../idl/events.rtpm.js";
import { printable } from "../core/bytes.js";
import type { EventField, EventType } from "../values/method.js";

const comparisons = ["==", "!=", "<", "<=", ">", ">=", "any bit"] as const;

/** How a number is compared; `any bit`: a bit of the operand is set, of whole numbers. */
export type Comparison = (typeof comparisons)[number];

const allBits = 0xffff_ffff;
const int64Max = (1n << 63n) - 1n;
// The numbers of bool and the unsigned types in EventField.
const unsignedTypes = new Set([0, 2, 4, 6, 8]);

// An EventType is invariant in its value.
// eslint-disable-next-line @typescript-eslint/no-explicit-any
type AnyEventType = EventType<any>;

/** Which events a consumer gets; the hub evaluates it. Immutable. */
export class EventFilter {
  private constructor(
    /** @internal */
    readonly node: FilterNode,
    /** The types whose numbers it names, or which its consumer knows. @internal */
    readonly types: readonly AnyEventType[],
  ) {}

  /** All events. */
  static everything(): EventFilter {
    return new EventFilter(FilterNode.of({ kind: NodeKind.Everything }), []);
  }

  /** The events of a type, of one source or of all. */
  static of<T, F extends string>(type: EventType<T, F>, source?: number): EventFilter {
    const ofSource = source === undefined ? {} : { source, sourceMask: allBits };
    const node = { kind: NodeKind.Match, type: type.type, typeMask: allBits, ...ofSource };
    return new EventFilter(FilterNode.of(node), [type]);
  }

  /**
   * The events of a type in which a number agrees: `where(TouchedEvent, "force.z", ">=", 5)`.
   * @param field  with dots, spelled as in the schema
   * @throws RangeError if the type has no such number
   */
  static where<T, F extends string>(
    type: EventType<T, F>,
    field: NoInfer<F>,
    comparison: Comparison,
    operand: number | bigint | boolean,
  ): EventFilter {
    if (!type.fields.some((one) => one.name === field)) {
      const known = type.fields.map((one) => one.name).join(", ");
      throw new RangeError(`${type.name} has no number ${printable(field)}, but ${known}`);
    }
    const node = FilterNode.of({
      kind: NodeKind.Where,
      type: type.type,
      field,
      comparison: comparisons.indexOf(comparison),
      operand: numberOf(operand),
    });
    return new EventFilter(node, [type]);
  }

  /** The events that any of the filters accepts. */
  static any(...filters: readonly EventFilter[]): EventFilter {
    return EventFilter.group(NodeKind.Any, filters);
  }
  /** The events that all of the filters accept. */
  static all(...filters: readonly EventFilter[]): EventFilter {
    return EventFilter.group(NodeKind.All, filters);
  }
  /** The events that the filter does not accept. */
  static not(filter: EventFilter): EventFilter {
    return EventFilter.group(NodeKind.Not, [filter]);
  }

  private static group(kind: NodeKind, filters: readonly EventFilter[]): EventFilter {
    const children = filters.map((one) => one.node);
    const types = new Set(filters.flatMap((one) => one.types));
    return new EventFilter(FilterNode.of({ kind, children }), [...types]);
  }
}

/** The type as a hub learns it. */
export function entryOf(type: AnyEventType): TypeEntry {
  return TypeEntry.of({
    type: type.type,
    name: type.name,
    schemaId: type.schemaId,
    fields: type.fields.map((field) =>
      FieldEntry.of({
        name: field.name,
        type: field.type,
        slots: Uint16Array.from(field.slots),
        offset: field.offset,
        defaultValue: defaultOf(field),
      }),
    ),
    schema: type.schema ?? "",
  });
}

function defaultOf({ type, defaultValue }: EventField): HubNumber | undefined {
  if (typeof defaultValue !== "bigint") {
    return defaultValue === undefined ? undefined : real(defaultValue);
  }
  return unsignedTypes.has(type) ? natural(defaultValue) : integer(defaultValue);
}

function numberOf(value: number | bigint | boolean): HubNumber {
  if (typeof value === "number" && !Number.isSafeInteger(value)) return real(value);
  const whole = BigInt(value);
  return whole > int64Max ? natural(whole) : integer(whole);
}

const integer = (value: bigint): HubNumber => ({
  integer: value,
  natural: 0n,
  real: 0,
  kind: NumberKind.Signed,
});
const natural = (value: bigint): HubNumber => ({
  integer: 0n,
  natural: value,
  real: 0,
  kind: NumberKind.Unsigned,
});
const real = (value: number): HubNumber => ({
  integer: 0n,
  natural: 0n,
  real: value,
  kind: NumberKind.Real,
});

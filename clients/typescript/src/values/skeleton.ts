import type { Interface, Method } from "./method.js";

/** A call as its servant sees it. */
export interface CallContext {
  /** The priority that the call carries, 0 to 32767. */
  readonly priority: number;
  /** The time that the caller still waits; undefined if it states no deadline. */
  readonly timeLeftMs: number | undefined;
  /** Aborted when the caller gave up; the method's result is then dropped. */
  readonly signal: AbortSignal;
  /** The caller's trace id, 64 bits; 0n for none. */
  readonly traceId: bigint;
}

/** A method with the servant's function behind it. */
export interface Operation<Q, R> {
  readonly method: Method<Q, R>;
  /**
   * Runs the method; of a stream it gives the items. An exception ends the call as servant_failed,
   * or as the status that it has.
   */
  run(request: Q, context: CallContext): R | Promise<R> | AsyncIterable<R>;
}

/** Makes an operation; checks that function and method agree in their types. */
export function operation<Q, R>(
  method: Method<Q, R>,
  run: (request: Q, context: CallContext) => R | Promise<R> | AsyncIterable<R>,
): Operation<Q, R> {
  return { method, run };
}

// A table has operations of any types: Operation is invariant, so unknown would not do.
// eslint-disable-next-line @typescript-eslint/no-explicit-any
export type AnyOperation = Operation<any, any>;

/** An object to serve: its interface, and what runs for each method by its number. */
export interface Skeleton {
  readonly description: Interface;
  readonly operations: ReadonlyMap<number, AnyOperation>;
}

/**
 * Makes a skeleton.
 * @throws Error unless there is one operation for each of the methods
 */
export function skeleton(description: Interface, operations: readonly AnyOperation[]): Skeleton {
  const table = new Map(operations.map((one) => [one.method.id, one]));
  for (const method of description.methods) {
    if (table.get(method.id)?.method !== method) {
      throw new Error(`${description.name}: method ${method.name} has no operation`);
    }
  }
  if (table.size !== operations.length || table.size !== description.methods.length) {
    throw new Error(`${description.name}: an operation is given twice or belongs to no method`);
  }
  return { description, operations: table };
}

package org.rtpm.values;

import java.util.HashMap;
import java.util.List;
import java.util.Map;
import java.util.Optional;

/**
 * An object to serve: its interface, and what runs for each method. Generated servants make one.
 *
 * <p>Threads: immutable.
 */
public final class Skeleton {
  private final Interface description;
  private final Map<Long, Operation<?, ?>> operations = new HashMap<>();

  /**
   * Creates a skeleton.
   *
   * @throws IllegalArgumentException unless there is one operation for each of the methods
   */
  public Skeleton(Interface description, List<Operation<?, ?>> operations) {
    this.description = description;
    for (Operation<?, ?> operation : operations) {
      Method<?, ?> method = operation.method();
      if (!description.methods().contains(method)
          || this.operations.put(method.id(), operation) != null) {
        throw new IllegalArgumentException(
            description.name() + ": method " + method.name() + " is unknown or given twice");
      }
    }
    if (operations.size() != description.methods().size()) {
      throw new IllegalArgumentException(description.name() + ": a method has no operation");
    }
  }

  /** The interface. */
  public Interface description() {
    return description;
  }

  /** The operation of a method's number; empty: no_such_method. */
  public Optional<Operation<?, ?>> operation(long methodId) {
    return Optional.ofNullable(operations.get(methodId));
  }
}

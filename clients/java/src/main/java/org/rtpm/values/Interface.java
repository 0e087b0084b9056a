package org.rtpm.values;

import java.util.List;
import java.util.Objects;

/**
 * One {@code rpc_service}, as generated code describes it: all that bind, describe and the
 * introspection of a server need (spec/hprotocol.md, 6.1, 6.3 and 12).
 *
 * @param name with its namespace, "lab.Arm"
 * @param fingerprint 64 bits, unsigned, of all methods (hp-12.1); 0 if unknown
 * @param methods in the order of the schema
 * @param priorityModel which side decides the priority
 * @param priority 0 to 32767; -1 if the schema states none
 * @param text the interface's text (hp-12.2); empty if unknown, then only equal fingerprints match
 * @param schema the service's complete schema, for tools without generated code; may be empty
 * @param compilerVersion the version of the rtpmc that generated this; may be empty
 */
public record Interface(
    String name,
    long fingerprint,
    List<Method<?, ?>> methods,
    PriorityModel priorityModel,
    int priority,
    String text,
    String schema,
    String compilerVersion) {
  /** Checks and copies the components. */
  public Interface {
    Objects.requireNonNull(name);
    Objects.requireNonNull(priorityModel);
    Objects.requireNonNull(text);
    Objects.requireNonNull(schema);
    Objects.requireNonNull(compilerVersion);
    methods = List.copyOf(methods);
  }

  /** An interface without text, schema and priority. */
  public Interface(String name, long fingerprint, List<Method<?, ?>> methods) {
    this(name, fingerprint, methods, PriorityModel.CLIENT_PROPAGATED, -1, "", "", "");
  }
}

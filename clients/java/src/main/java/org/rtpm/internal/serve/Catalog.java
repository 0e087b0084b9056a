package org.rtpm.internal.serve;

import java.util.Map;
import org.rtpm.Refusal;
import org.rtpm.Status;
import org.rtpm.values.CallContext;
import org.rtpm.values.Interface;
import rtpm.introspection.DescribeRequest;
import rtpm.introspection.Description;
import rtpm.introspection.IntrospectionServant;
import rtpm.introspection.ListReply;
import rtpm.introspection.ObjectEntry;

/** What a server serves, for tools without generated code. */
final class Catalog implements IntrospectionServant {
  /** The catalog's path in every server. */
  static final String PATH = "rtpm/introspection";

  private final ObjectTable objects;

  Catalog(ObjectTable objects) {
    this.objects = objects;
  }

  private Map<String, Interface> seenBy(CallContext context) {
    return objects.interfaces(((ServedCall) context)::maySee);
  }

  @Override
  public ListReply list(CallContext context) {
    return new ListReply(
        seenBy(context).entrySet().stream()
            .map(each -> new ObjectEntry(each.getKey(), each.getValue().name()))
            .toList());
  }

  @Override
  public Description describe(DescribeRequest request, CallContext context) {
    if (request.path().isEmpty() == request.interface_().isEmpty()) {
      throw new Refusal(Status.BAD_REQUEST, "exactly one of path and interface is to be set");
    }
    for (Map.Entry<String, Interface> each : seenBy(context).entrySet()) {
      Interface found = each.getValue();
      boolean isWanted =
          each.getKey().equals(request.path()) || found.name().equals(request.interface_());
      // An interface that a program wrote by hand may have no schema.
      if (isWanted && !found.schema().isEmpty()) {
        return new Description(
            found.name(), found.fingerprint(), found.compilerVersion(), found.schema());
      }
    }
    throw new Refusal(Status.GONE, "");
  }
}

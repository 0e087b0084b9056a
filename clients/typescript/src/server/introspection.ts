import {
  introspectionSkeleton,
  type DescribeRequest,
  type Description,
  type IntrospectionServant,
  type ListReply,
} from "../../idl/introspection.rtpm.js";
import type { Interface } from "../values/method.js";
import type { Skeleton } from "../values/skeleton.js";
import { Refusal } from "./dispatcher.js";

/** Where tools ask for a server's objects and their schemas. */
export const introspectionPath = "rtpm/introspection";

/** The objects of a server by path, without this one. */
export type Catalog = () => Iterable<readonly [path: string, description: Interface]>;

class Introspection implements IntrospectionServant {
  constructor(private readonly catalog: Catalog) {}

  list(): ListReply {
    const objects = [...this.catalog()].map(([path, { name }]) => ({ path, interface: name }));
    objects.sort((a, b) => (a.path < b.path ? -1 : 1));
    return { objects };
  }

  describe(request: DescribeRequest): Description {
    // Exactly one of them is set.
    if ((request.path === "") === (request.interface === "")) throw new Refusal("bad_request");
    const isMeant = ([path, { name }]: readonly [string, Interface]): boolean =>
      request.path === "" ? name === request.interface : path === request.path;
    const found = [...this.catalog()].find(isMeant)?.[1];
    // An interface that was written by hand has no schema.
    if (found?.schema === undefined) throw new Refusal("gone");
    const { name, fingerprint, compilerVersion = "", schema } = found;
    return { interface: name, fingerprint, compilerVersion, schema };
  }
}

/** The object `rtpm/introspection`, by which tools call the others without generated code. */
export function introspectionOf(catalog: Catalog): Skeleton {
  return introspectionSkeleton(new Introspection(catalog));
}

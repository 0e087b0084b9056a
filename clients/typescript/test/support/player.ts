import { fromHex } from "../../src/core/bytes.js";
import { FreeBytes } from "./free_bytes.js";
import { ClientSide, ServerSide, type Output, type Side } from "./sides.js";
import type { Json } from "./vectors.js";

export type Role = "client" | "server";

function kindOf(step: Json, role: Role): "input" | "output" | "nothing" {
  const other = role === "client" ? "server" : "client";
  if (step.frame !== undefined) {
    if (step.frame === `${role} to ${other}`) return "output";
    if (step.frame === `network to ${role}`) return "input";
    return step.frame === `${other} to ${role}` && step.is_lost !== true ? "input" : "nothing";
  }
  if (step[`${role}_sees`] !== undefined || step[`${role}_counts`] !== undefined) return "output";
  if (step[`${role}_does`] !== undefined || step.network_does !== undefined) return "input";
  return "nothing";
}

function isSame(a: Json, b: Json): boolean {
  const names = new Set([...Object.keys(a), ...Object.keys(b)]);
  return [...names].every((name) => a[name] === b[name]);
}

/**
 * Plays a conversation of spec/vectors/conversations with our code as one side. Returns the first
 * step where it does not do exactly what the vector says, and what it did; "" if there is none.
 */
export function play(conversation: Json, role: Role): string {
  const free = new FreeBytes(conversation.free, role);
  const side: Side =
    role === "server" ? new ServerSide(conversation) : new ClientSide(conversation);
  let outputs: Output[] = [];
  const surplus = (): string =>
    outputs.length === 0 ? "" : `not in the vector: ${JSON.stringify(outputs)}`;
  const consume = (step: Json): boolean => {
    const wanted = { ...step };
    delete wanted.at_ns;
    if (wanted.call_id !== undefined) wanted.call_id = free.number(wanted.call_id);
    const index = outputs.findIndex((output) => {
      if ("hex" in output) return step.frame !== undefined && free.matches(step.hex, output.hex);
      const there = { ...output.step };
      // With one open call a vector need not name it.
      if (wanted.call_id === undefined) delete there.call_id;
      return step.frame === undefined && isSame(there, wanted);
    });
    if (index >= 0) outputs.splice(index, 1);
    return index >= 0;
  };
  for (const [index, step] of (conversation.steps as Json[]).entries()) {
    const kind = kindOf(step, role);
    if (kind === "output" && !consume(step)) {
      const what = JSON.stringify(outputs, undefined, 1);
      return `step ${index}: wanted ${JSON.stringify(step)}\nwhat happened: ${what}`;
    }
    if (kind !== "input") continue;
    if (outputs.length > 0) return `before step ${index}, ${surplus()}`;
    const now = step.arrives_ns ?? step.at_ns;
    outputs =
      step.frame === undefined
        ? side.act(step, free, now)
        : side.receive(
            fromHex(free.fillIn(step.hex)),
            (step.address ?? "client") !== "client",
            now,
          );
  }
  return surplus();
}

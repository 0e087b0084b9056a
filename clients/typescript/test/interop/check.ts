import assert from "node:assert/strict";
import { setTimeout as sleep } from "node:timers/promises";
import { isDeepStrictEqual } from "node:util";
import { InteropClient, InteropInterface } from "../../idl/tests/interop.rtpm.js";
import { CallError, Node, parseUrl, type Binding, type NodeKeys } from "../../src/index.js";
import { callCases } from "./calls.js";
import type { Options } from "./options.js";
import { serviceCases } from "./services.js";
import { streamCases } from "./streams.js";

/** Ends a case as neither passed nor failed. */
export class Left extends Error {
  constructor(
    readonly result: "not_offered" | "skipped",
    detail: string,
  ) {
    super(detail);
  }
}

/** All that the cases have at hand. */
export interface Laboratory {
  readonly url: string;
  readonly options: Options;
  /** Calls the server. */
  readonly node: Node;
  readonly binding: Binding;
  readonly interop: InteropClient;
  /** Calls the registry, the hub and the devices, which take no sealed sessions. */
  readonly services: Node;
  newServices(): Node;
}

/** A case returns once it has passed, and throws otherwise. */
export type Case = (laboratory: Laboratory) => Promise<void>;

const caseTimeMs = 20_000;

/** @returns whether no case failed */
export async function check(url: string, options: Options): Promise<boolean> {
  const laboratory = await enter(url, options);
  let hasFailed = false;
  // It waits for more than 2 s, and disturbs no other.
  const idle = resultOf(serviceCases["name"]!, laboratory);
  for (const [name, run] of Object.entries({ ...callCases, ...streamCases, ...serviceCases })) {
    const { result, detail } = await (name === "name" ? idle : resultOf(run, laboratory));
    if (result === "fail") hasFailed = true;
    process.stdout.write(`${JSON.stringify({ case: name, result, detail })}\n`);
  }
  await laboratory.node.close();
  await laboratory.services.close();
  return !hasFailed;
}

async function enter(url: string, options: Options): Promise<Laboratory> {
  const { transport, registry, own, other } = options;
  const registries = registry === undefined ? [] : [registry];
  const plainPort = registry === undefined ? undefined : parseUrl(registry)?.port;
  const keys: NodeKeys | undefined =
    own === undefined
      ? undefined
      : { own, serverKey: (_host, port) => (port === plainPort ? undefined : other) };
  const base = { transport, registries, deadlineMs: 5000 };
  const node = new Node({ ...base, ...(keys === undefined ? {} : { keys }) });
  const binding = await node.bind(url, InteropInterface);
  const newServices = (): Node => new Node(base);
  const interop = new InteropClient(binding);
  return { url, options, node, binding, interop, services: newServices(), newServices };
}

async function resultOf(
  run: Case,
  laboratory: Laboratory,
): Promise<{ result: string; detail: string }> {
  const late = new AbortController();
  const timeout = sleep(caseTimeMs, undefined, { signal: late.signal }).then(
    () => {
      throw new Error(`it took more than ${caseTimeMs} ms`);
    },
    () => undefined,
  );
  try {
    await Promise.race([run(laboratory), timeout]);
    return { result: "pass", detail: "" };
  } catch (error) {
    const detail = error instanceof Error ? error.message : String(error);
    return { result: error instanceof Left ? error.result : "fail", detail };
  } finally {
    late.abort();
  }
}

// ---- for the cases ------------------------------------------------------------------------------

export async function failure(call: Promise<unknown>): Promise<CallError> {
  try {
    await call;
  } catch (error) {
    if (error instanceof CallError) return error;
    throw error;
  }
  return assert.fail("a call went well that should have failed");
}

/** Fails in few words: the values may be large. */
export function same(actual: unknown, expected: unknown, what: string): void {
  if (isDeepStrictEqual(actual, expected)) return;
  const text = (value: unknown): string =>
    JSON.stringify(value, (_, one: unknown) => (typeof one === "bigint" ? `${one}` : one)).slice(
      0,
      200,
    );
  assert.fail(`${what}: ${text(actual)} instead of ${text(expected)}`);
}

export async function until(isTrue: () => Promise<boolean>, ms: number): Promise<boolean> {
  const end = performance.now() + ms;
  for (;;) {
    if (await isTrue()) return true;
    if (performance.now() >= end) return false;
    await sleep(10);
  }
}

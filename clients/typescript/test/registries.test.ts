import assert from "node:assert/strict";
import { test } from "node:test";
import { CallError, Node } from "../src/index.js";
import { registryAddresses } from "../src/core/url.js";

// The forms in which `registries` and RTPM_REGISTRY name registries.

const good: readonly (readonly [string, ...string[]])[] = [
  ["localhost", "rtpm://localhost:7420/rtpm/names"],
  ["127.0.0.1:9999", "rtpm://127.0.0.1:9999/rtpm/names"],
  ["::1", "rtpm://[::1]:7420/rtpm/names"],
  ["[::1]", "rtpm://[::1]:7420/rtpm/names"],
  ["[fe80::1%25eth0]:9999", "rtpm://[fe80::1%25eth0]:9999/rtpm/names"],
  ["rtpm://127.0.0.1", "rtpm://127.0.0.1:7420/rtpm/names"],
  ["rtpm://127.0.0.1:9999", "rtpm://127.0.0.1:9999/rtpm/names"],
  ["rtpm://[::1]:9999/rtpm/names", "rtpm://[::1]:9999/rtpm/names"],
  ["rtpm://a,b:9999/other", "rtpm://a,b:9999/other"],
  ["a,rtpm://b:1", "rtpm://a:7420/rtpm/names", "rtpm://b:1/rtpm/names"],
];
const bad = [
  "",
  "lab/arm0",
  "host:",
  "host:port",
  "host:65536",
  "[::1",
  "[::1]:",
  "http://host:7420/rtpm/names",
  "rtpm://",
  "rtpm://host/",
];

for (const [text, ...addresses] of good) {
  test(`a registry "${text}"`, () => assert.deepEqual(registryAddresses(text), addresses));
}

test("other forms are refused, with those that there are", () => {
  for (const text of bad) {
    assert.throws(
      () => registryAddresses(text),
      (error) => {
        assert.ok(error instanceof RangeError);
        assert.ok(error.message.startsWith(`"${text}" is no address of a registry`));
        assert.match(error.message, /host:port, \[ipv6\]:port, rtpm:\/\/host/);
        return true;
      },
    );
  }
});

test("both places take the same forms, and the registry's error has the address", async () => {
  const stated = process.env["RTPM_REGISTRY"];
  const form = "127.0.0.1:1";
  const asked = async (newNode: () => Node): Promise<string> => {
    await using node = newNode();
    const failure = await node.names.list("", { deadlineMs: 100 }).catch((error: unknown) => error);
    assert.ok(failure instanceof CallError, String(failure));
    assert.equal(failure.code, "unreachable");
    assert.match(failure.message, /^the registry rtpm:\/\/127\.0\.0\.1:1\/rtpm\/names: /);
    return failure.message;
  };
  try {
    process.env["RTPM_REGISTRY"] = form;
    const byEnvironment = await asked(() => new Node());
    assert.match(byEnvironment, /start rtpm-registryd, .* in RTPM_REGISTRY or `registries`$/);
    process.env["RTPM_REGISTRY"] = "no/host";
    assert.throws(() => new Node(), RangeError);
    assert.equal(await asked(() => new Node({ registries: [form] })), byEnvironment);
    assert.throws(() => new Node({ registries: ["no/host"] }), RangeError);
  } finally {
    if (stated === undefined) delete process.env["RTPM_REGISTRY"];
    else process.env["RTPM_REGISTRY"] = stated;
  }
});

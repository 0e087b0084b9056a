import assert from "node:assert/strict";
import { execFile } from "node:child_process";
import { mkdtemp, readFile, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, describe, test } from "node:test";
import { promisify } from "node:util";
import { endAll, programFolder, start } from "./support/programs.js";

// They find the package by its own name.

describe("the examples for Node", { skip: programFolder === undefined }, () => {
  const example = new URL("../../examples/log_session.js", import.meta.url).pathname;
  let folder = "";
  let environment: NodeJS.ProcessEnv = {};

  const log = (...args: string[]): Promise<{ stdout: string; stderr: string }> =>
    promisify(execFile)(process.execPath, [example, ...args], { env: environment, timeout: 30_000 });

  interface Failure {
    readonly code: number;
    readonly stdout: string;
    readonly stderr: string;
  }
  const failed = (run: Promise<unknown>): Promise<Failure> =>
    run.then(
      () => assert.fail("it should have failed"),
      (error: unknown) => error as Failure,
    );

  before(async () => {
    folder = await mkdtemp(join(tmpdir(), "rtpm-log-"));
    const registry = await start("rtpm-registryd", ["--port", "0"], /(rtpm:\S+)/);
    environment = { ...process.env, RTPM_REGISTRY: registry };
    const options = ["--registry", registry, "--port", "0", "--serve-events", "--stops", "none"];
    const devices = ["--devices", "arm0,knob0", "--settings", ""];
    await start("rtpm-deviced", [...options, ...devices], /(serving lab\/knob0)/);
  });
  after(async () => {
    await endAll();
    await rm(folder, { recursive: true });
  });

  test("writes the samples of all devices, and the hub's events", async () => {
    const file = join(folder, "session.jsonl");
    // The simulated hand presses its button every two seconds, which is an event.
    const { stdout } = await log(file, "--seconds", "4");
    const lines = (await readFile(file, "utf8")).trimEnd().split("\n");
    const read = lines.map((line) => JSON.parse(line) as Record<string, unknown>);
    for (const device of ["lab/arm0", "lab/knob0"]) {
      const samples = read.filter((line) => line["device"] === device && "sample" in line);
      assert.ok(samples.length > 10, `${device}: ${samples.length} samples`);
      const [{ sample }] = samples as [{ sample: { hostTimeNs: string } }];
      assert.match(sample.hostTimeNs, /^\d+$/);
    }
    const events = read.filter((line) => "event" in line) as { event: { payload: string } }[];
    assert.ok(events.length > 0);
    for (const { event } of events) assert.match(event.payload, /^([0-9a-f]{2})*$/);
    const counts = JSON.parse(stdout) as Record<string, number>;
    assert.equal(
      Object.values(counts).reduce((sum, count) => sum + count, 0),
      lines.length,
    );
  });

  test("tells of a device that is not there, and logs the others", async () => {
    const file = join(folder, "other.jsonl");
    const names = ["--device", "lab/arm9", "--device", "lab/arm0"];
    const failure = await failed(log(file, "--seconds", "2", ...names));
    assert.match(failure.stderr, /^lab\/arm9: .*no server has bound this name/m);
    assert.match(failure.stdout, /"lab\/arm0":\d+/);
    assert.equal(failure.code, 1);
  });

  test("refuses other arguments, and says how it is used", async () => {
    const file = join(folder, "unused.jsonl");
    for (const args of [[file, "--seconds", "abc"], [file, "--second", "1"], [], [file, file]]) {
      const failure = await failed(log(...args));
      assert.match(failure.stderr, /^usage: /m);
      assert.doesNotMatch(failure.stderr, /^ +at /m);
      assert.equal(failure.code, 2);
    }
  });

  test("the first example of README.md is a whole program", async () => {
    const readme = await readFile(new URL("../../README.md", import.meta.url), "utf8");
    const program = /```js\n(.*?)```/s.exec(readme)?.[1] ?? "";
    const cwd = new URL("../..", import.meta.url); // where "rtpm" is this package
    const options = { cwd, env: environment, timeout: 20_000 };
    const args = ["--input-type=module", "--eval", program];
    const { stdout } = await promisify(execFile)(process.execPath, args, options);
    assert.match(stdout, /^x \S+ m, y \S+ m, z \S+ m\n$/);
  });

  test("fails where the file cannot be written", async () => {
    await assert.rejects(log(join(folder, "none", "session.jsonl")), /ENOENT/);
  });
});

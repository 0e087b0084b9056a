import { execFile, spawn, type ChildProcess } from "node:child_process";
import { once } from "node:events";
import { join } from "node:path";
import { createInterface } from "node:readline";
import { promisify } from "node:util";

// RTPM's own programs, in the folder that RTPM_PROGRAMS names.

export const programFolder = process.env["RTPM_PROGRAMS"];
const children: { readonly name: string; readonly child: ChildProcess }[] = [];

/** Starts a program; the first group of the first line that matches, when it is printed. */
export async function start(
  name: string,
  args: readonly string[],
  wanted: RegExp,
  environment: Readonly<Record<string, string>> = {},
): Promise<string> {
  const child = spawn(join(programFolder!, name), args, {
    stdio: ["ignore", "pipe", "inherit"],
    env: { ...process.env, ...environment },
  });
  children.push({ name, child });
  const lines = createInterface({ input: child.stdout! });
  const timer = setTimeout(() => child.kill("SIGKILL"), 20_000);
  for await (const line of lines) {
    const found = wanted.exec(line);
    if (found === null) continue;
    clearTimeout(timer);
    child.stdout!.resume();
    return found[1] ?? line;
  }
  throw new Error(`${name} ended, or said nothing that matches ${wanted}`);
}

/** Ends the programs of that name that start() started; without a name, all. */
export async function endAll(name?: string): Promise<void> {
  for (const one of [...children]) {
    if (name !== undefined && one.name !== name) continue;
    children.splice(children.indexOf(one), 1);
    const { child } = one;
    if (child.exitCode !== null || child.signalCode !== null) continue;
    child.kill("SIGTERM");
    await once(child, "exit");
  }
}

/** Runs a program to its end; what it printed. */
export async function run(
  name: string,
  args: readonly string[],
  registry: string,
): Promise<string> {
  const env = { ...process.env, RTPM_REGISTRY: registry };
  const options = { env, timeout: 20_000 };
  const { stdout } = await promisify(execFile)(join(programFolder!, name), args, options);
  return stdout;
}

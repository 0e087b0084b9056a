// Logs a session: the samples of devices and the events of the hub, one line of JSON each.
//   node log_session.js FILE.jsonl [--seconds N] [--device NAME]…
// Without --device all devices of the registry. Ctrl-C ends it. Times are nanoseconds, as text; the
// payloads of events are hexadecimal. It exits with 1 if a device could not be logged.
import { once } from "node:events";
import { createWriteStream } from "node:fs";
import { finished } from "node:stream/promises";
import { parseArgs } from "node:util";
import { Device, EventConsumer, Node } from "rtpm";
import { DeviceInterface } from "rtpm/idl/device";

function refuse(why) {
  console.error(`${why}\nusage: node log_session.js FILE.jsonl [--seconds N] [--device NAME]…`);
  process.exit(2);
}

function readArguments() {
  const options = { seconds: { type: "string" }, device: { type: "string", multiple: true } };
  try {
    return parseArgs({ allowPositionals: true, options });
  } catch (error) {
    return refuse(error.message);
  }
}

const { values, positionals } = readArguments();
if (positionals.length !== 1) refuse(`one file is needed, not ${positionals.length}`);
const seconds = Number(values.seconds ?? Infinity);
if (!(seconds > 0)) refuse(`--seconds takes a number above 0, not "${values.seconds}"`);

const file = createWriteStream(positionals[0]);
await once(file, "open");
const node = new Node();
const end = new AbortController();
process.once("SIGINT", () => end.abort());
file.once("error", (error) => end.abort(error));
if (seconds < Infinity) setTimeout(() => end.abort(), 1000 * seconds).unref();

const counts = {};
const asJson = (_, value) =>
  typeof value === "bigint" ? String(value) : ArrayBuffer.isView(value) ? [...value] : value;
async function log(what, line) {
  counts[what] = (counts[what] ?? 0) + 1;
  // A slow disk makes the reader wait, and not the memory grow.
  if (!file.write(`${JSON.stringify(line, asJson)}\n`)) {
    await once(file, "drain", { signal: end.signal }).catch(() => undefined);
  }
}

async function logDevice(name) {
  const device = await Device.open(node, name);
  await log(name, { device: name, description: await device.describe() });
  for await (const sample of device.samples({ intervalMs: 20, signal: end.signal })) {
    await log(name, { device: name, sample });
  }
}

async function logEvents() {
  const options = { name: "log_session", signal: end.signal };
  const events = await EventConsumer.open(node, "rtpm/events", options);
  for await (const event of events) {
    const payload = Buffer.from(event.payload).toString("hex");
    await log("events", { event: { ...event, payload } });
  }
}

/** One source that fails is told of, and does not end the others. */
async function follow(what, run) {
  await run(what).catch((error) => {
    if (end.signal.aborted) return;
    console.error(`${what}: ${error.message}`);
    if (run === logDevice) process.exitCode = 1;
  });
}

const all = (await node.names.list()).filter((one) => one.interface === DeviceInterface.name);
const devices = values.device ?? all.map((one) => one.name);
console.error(`logging ${devices.join(", ") || "no device"}, and events`);
await Promise.all([...devices.map((name) => follow(name, logDevice)), follow("events", logEvents)]);
file.end();
await finished(file);
await node.close();
console.log(JSON.stringify(counts));

// A scripted session of the Foxglove client of npm: node session.mjs URL SUBPROTOCOL. Prints what it
// saw as JSON.
import protocol from "@foxglove/ws-protocol";
import { ByteBuffer } from "flatbuffers";
import WebSocket from "ws";

const [url, subprotocol] = process.argv.slice(2);
const socket = new WebSocket(url, [subprotocol]);
socket.binaryType = "arraybuffer";
const client = new protocol.FoxgloveClient({ ws: socket });
const seen = { samples: [], statuses: [], graph: false };
const channels = new Map();
const services = new Map();
const topics = new Map();
const waiting = [];

// Resolves when `isMet` holds, which is asked after each event.
function until(isMet) {
  return new Promise((resolve) => {
    waiting.push({ isMet, resolve });
    wake();
  });
}
function wake() {
  for (const one of waiting.splice(0)) {
    if (one.isMet()) one.resolve();
    else waiting.push(one);
  }
}
function on(event, take) {
  client.on(event, (argument) => {
    take(argument);
    wake();
  });
}

// The field `slot` of a table of the generated layout.
function field(bytes, table, slot) {
  const offset = bytes.__offset(table, 4 + 2 * slot);
  return offset === 0 ? 0 : table + offset;
}

// A message rtpm.device.Sampled: its only field is the struct Sample.
function sampleOf(data) {
  const bytes = new ByteBuffer(new Uint8Array(data.buffer, data.byteOffset, data.byteLength));
  const root = bytes.readInt32(bytes.position()) + bytes.position();
  const sample = field(bytes, root, 0);
  return {
    sequence: Number(bytes.readUint64(sample)),
    position_m: [24, 32, 40].map((offset) => bytes.readFloat64(sample + offset)),
  };
}

const values = new Map();
const answers = new Map();
on("serverInfo", (info) => (seen.info = info));
on("status", (status) => seen.statuses.push(status));
on("advertise", (list) => list.forEach((channel) => channels.set(channel.topic, channel)));
on("unadvertise", () => {});
on("advertiseServices", (list) => list.forEach((service) => services.set(service.name, service)));
on("parameterValues", (reply) => values.set(reply.id ?? "update", reply.parameters));
on("connectionGraphUpdate", () => (seen.graph = true));
on("serviceCallResponse", (reply) => answers.set(reply.callId, reply.data));
on("serviceCallFailure", (reply) => answers.set(reply.callId, reply.message));
on("message", (message) => {
  const topic = topics.get(message.subscriptionId);
  if (topic === "lab/arm0/sample") seen.samples.push(sampleOf(message.data));
  if (topic === "console/state") seen.state = JSON.parse(new TextDecoder().decode(message.data));
});
on("error", (error) => {
  process.stderr.write(`${error.message ?? error}\n`);
  process.exit(1);
});

let lastCall = 0;
async function call(name, request) {
  await until(() => services.has(name));
  const bytes = new TextEncoder().encode(JSON.stringify(request));
  const callId = ++lastCall;
  client.sendServiceCallRequest({
    serviceId: services.get(name).id,
    callId,
    encoding: "json",
    data: new DataView(bytes.buffer),
  });
  await until(() => answers.has(callId));
  const answer = answers.get(callId);
  return typeof answer === "string" ? answer : JSON.parse(new TextDecoder().decode(answer));
}

client.on("open", async () => {
  for (const topic of ["lab/arm0/sample", "console/state"]) {
    await until(() => channels.has(topic));
    topics.set(client.subscribe(channels.get(topic).id), topic);
  }
  await until(() => seen.samples.length >= 5 && seen.state !== undefined);
  seen.described = await call("lab/arm0/describe", {});
  seen.refused = await call("console/take_over", { device: "lab/none" });
  const ramp = "lab/arm0.safety.ramp_s";
  client.subscribeParameterUpdates([ramp]);
  client.getParameters([ramp], "get");
  await until(() => values.has("get"));
  client.setParameters([{ name: ramp, value: 0.017, type: "float64" }], "set");
  await until(() => values.has("set") && values.has("update"));
  seen.values = Object.fromEntries(values);
  client.subscribeConnectionGraph();
  await until(() => seen.graph);
  for (const id of topics.keys()) client.unsubscribe(id);
  process.stdout.write(JSON.stringify(seen));
  client.close();
});

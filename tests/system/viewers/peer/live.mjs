// Prints the channels of a console with what a viewer decodes, when each of some topics has had 20
// messages: node live.mjs URL TOPIC,TOPIC… [LICHTBLICK]
import protocol from "@foxglove/ws-protocol";
import WebSocket from "ws";
import { decoderOf, opened, plain } from "./schemas.mjs";

const [url, topics, lichtblick] = process.argv.slice(2);
const missing = new Set(topics.split(","));
const makeDecoder = await decoderOf(lichtblick);
const client = new protocol.FoxgloveClient({ ws: new WebSocket(url, ["foxglove.websocket.v1"]) });
const channels = new Map();
client.on("advertise", (list) => {
  for (const { id, topic, encoding, schemaName, schema } of list) {
    const one = { encoding, schemaName, schema: Buffer.from(schema, "base64") };
    const subscription = client.subscribe(id);
    channels.set(subscription, { topic, ...opened(makeDecoder, one), ...one, messages: [], count: 0 });
  }
});
client.on("message", ({ subscriptionId, timestamp, data }) => {
  const channel = channels.get(subscriptionId);
  if (channel?.decode === undefined) return;
  const bytes = new Uint8Array(data.buffer, data.byteOffset, data.byteLength);
  const value = channel.decode(bytes);
  channel.messages.push({ log_time_ns: timestamp, value });
  // A scene counts if it shows a force.
  if (value.entities?.[0].arrows.length !== 0) ++channel.count;
  if (channel.count >= 20 && missing.delete(channel.topic) && missing.size === 0) end();
});
client.on("error", (error) => {
  process.stderr.write(`${error.message ?? error}\n`);
  process.exit(1);
});
// The test finds which are missing at the deadline.
setTimeout(end, 30_000);

function end() {
  const list = [...channels.values()].map(({ topic, encoding, schemaName, refusal, messages }) =>
    ({ topic, encoding, schema: schemaName, refusal, messages }));
  process.stdout.write(JSON.stringify(list, plain), () => process.exit(0));
}

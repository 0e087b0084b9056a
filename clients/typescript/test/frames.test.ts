import assert from "node:assert/strict";
import { test } from "node:test";
import { fromHex, toHex } from "../src/core/bytes.js";
import { ClientChannel } from "../src/core/client_channel.js";
import { frameOf, newHeader, readFrame, readHeader, type Header } from "../src/core/header.js";
import * as numbers from "../src/core/numbers.js";
import { ServerSessions } from "../src/core/server_sessions.js";
import { DropWatch, fixedRandom, readVectors, type Json } from "./support/vectors.js";

// spec/vectors/constants.json and headers-*.json.

const { Flag, FrameKind, Status } = numbers;

test("the numbers are those of the page", () => {
  const constants = readVectors("constants.json");
  assert.equal(numbers.protocolVersion, constants.version);
  assert.equal(numbers.headerSize, constants.header_size);
  assert.equal(numbers.defaultPort, constants.default_port);
  assert.deepEqual({ ...FrameKind }, constants.kinds);
  assert.deepEqual({ ...Status }, constants.statuses);
  const { ackWanted, noReply, repeated, replyOnReceipt } = Flag;
  assert.deepEqual(
    { repeated, ack_wanted: ackWanted, no_reply: noReply, reply_on_receipt: replyOnReceipt },
    constants.flags,
  );
  assert.equal(numbers.sessionService, constants.session_service);
  const { bind, ping, describe } = numbers.SessionMethod;
  assert.deepEqual(
    [bind, ping, describe],
    [constants.method_bind, constants.method_ping, constants.method_describe],
  );
  assert.deepEqual(
    {
      datagram_frame_size_max: numbers.datagramFrameSizeMax,
      datagram_payload_size_max: numbers.datagramPayloadSizeMax,
      stream_frame_size_max: numbers.streamFrameSizeMax,
      stream_payload_size_max: numbers.streamPayloadSizeMax,
      fragment_window: numbers.fragmentWindow("datagram"),
      stream_fragment_window: numbers.fragmentWindow("stream"),
      fragment_count_max: numbers.fragmentCountMax,
      stream_window: numbers.streamWindowMax,
      stream_lease_max_ms: numbers.streamLeaseMax / numbers.millisecond,
      stream_silence_ms: numbers.streamSilence / numbers.millisecond,
      stream_bytes_first_datagram: numbers.streamBytesFirst("datagram"),
      stream_bytes_first_stream: numbers.streamBytesFirst("stream"),
      stream_ask_interval_max_ms: numbers.streamAskIntervalMax / numbers.millisecond,
      message_size_floor: numbers.messageSizeFloor,
      message_size_ceiling: numbers.messageSizeCeiling,
      call_window: numbers.callWindow,
      session_idle_min_s: numbers.sessionIdleMin / numbers.second,
      cookie_span_s: numbers.cookieSpan / numbers.second,
      path_size_max: numbers.pathSizeMax,
      copy_interval_first_us: numbers.copyIntervalFirst / numbers.microsecond,
      copy_interval_min_us: numbers.copyIntervalMin / numbers.microsecond,
      copy_interval_max_us: numbers.copyIntervalMax / numbers.microsecond,
    },
    constants.limits,
  );
});

function shownHeader(vector: Json): Header {
  const shown = vector.header;
  const kind = FrameKind[shown.kind as keyof typeof FrameKind];
  const header = newHeader(kind, shown.priority, vector.payload.length / 2);
  if (shown.is_repeated) header.flags |= Flag.repeated;
  if (shown.is_ack_wanted) header.flags |= Flag.ackWanted;
  if (shown.is_no_reply) header.flags |= Flag.noReply;
  if (shown.is_reply_on_receipt) header.flags |= Flag.replyOnReceipt;
  header.session = BigInt(shown.session);
  header.callId = shown.call_id;
  header.service = shown.service;
  header.method = shown.method;
  header.status = Status[shown.status as numbers.StatusName];
  header.fragmentIndex = shown.fragment_index;
  header.fragmentCount = shown.fragment_count;
  header.messageSize = shown.message_size;
  header.budgetUs = shown.budget_us;
  header.item = shown.item;
  header.senderTimeNs = BigInt(shown.sender_time_ns);
  header.traceId = BigInt(shown.trace_id);
  return header;
}

for (const vector of readVectors("headers-good.json").vectors as Json[]) {
  test(`a good header: ${vector.name}`, () => {
    const header = readHeader(fromHex(vector.hex));
    assert.deepEqual(header, shownHeader(vector));
    assert.equal(toHex(frameOf(shownHeader(vector), fromHex(vector.payload))), vector.hex);
  });
}

/** Gives a frame to one side; the reasons for which it was dropped, and what happened besides. */
function outcomeAt(side: string, frame: Uint8Array, medium: numbers.Medium): Json {
  const random = fixedRandom();
  const receiver =
    side === "server"
      ? new ServerSessions({ medium, epoch: 1n, random })
      : new ClientChannel({ medium, clientEpoch: 1n, channel: 1n });
  const drops = new DropWatch(receiver.counters);
  receiver.onFrame(frame, { key: "a:1", host: "a" } as never, 1 as never);
  const events = receiver.takeEvents().map((event) => event.kind);
  return {
    dropped: drops.since(),
    isAnswered: receiver.takeFrames().length > 0,
    hasEnded: events.includes("hang_up") || events.includes("broken"),
  };
}

for (const vector of readVectors("headers-bad.json").vectors as Json[]) {
  test(`a bad header: ${vector.name}`, () => {
    const sides = vector.receiver === "any" ? ["server", "client"] : [vector.receiver];
    for (const side of sides) {
      for (const medium of vector.medium as numbers.Medium[]) {
        assert.deepEqual(
          outcomeAt(side, fromHex(vector.hex), medium),
          {
            dropped: [vector.drop],
            isAnswered: false,
            hasEnded: medium === "stream" && vector.ends_stream,
          },
          `at a ${side} of a ${medium}`,
        );
      }
    }
  });
}

test("a frame larger than its medium allows is dropped", () => {
  const header = newHeader(FrameKind.CALL, 0, 1345);
  assert.equal(readFrame(frameOf(header, new Uint8Array(1345)), "datagram"), "bad_length");
});

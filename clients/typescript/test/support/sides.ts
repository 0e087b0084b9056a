import assert from "node:assert/strict";
import { fromHex, toHex } from "../../src/core/bytes.js";
import {
  ClientChannel,
  hasNotRun,
  type ChannelEvent,
  type OpenCall,
} from "../../src/core/client_channel.js";
import { Status, statusName, type StatusName } from "../../src/core/numbers.js";
import { ServerSessions, type Request } from "../../src/core/server_sessions.js";
import type { FreeBytes } from "./free_bytes.js";
import { DropWatch, fixedRandom, type Json } from "./vectors.js";

/** An act of the tested side: a frame that it sent, or a step without its time. */
export type Output = { hex: string } | { step: Json };

/** One side of the protocol behind the words of the steps. */
export interface Side {
  /** @param isForeign  whether the frame comes from another address than the client's */
  receive(frame: Uint8Array, isForeign: boolean, now: number): Output[];
  act(step: Json, free: FreeBytes, now: number): Output[];
}

export class ServerSide implements Side {
  private sessions: ServerSessions;
  private drops: DropWatch;
  private readonly running = new Map<number, Request>();
  private connection = 1;
  private readonly random = fixedRandom();

  constructor(private readonly conversation: Json) {
    const { setup } = conversation;
    this.sessions = this.start(BigInt(setup.server.epoch));
    this.drops = new DropWatch(this.sessions.counters);
  }

  private start(epoch: bigint): ServerSessions {
    const { server } = this.conversation.setup;
    const bands: [number, number][] = server.bands ?? [server.band];
    return new ServerSessions({
      medium: this.conversation.medium,
      bands: bands.map(([low, high]) => ({ low, high })),
      ceiling: server.ceiling,
      epoch,
      clockDomain: BigInt(server.clock_domain),
      sessionCountMax: server.session_count_max,
      messageSizeMax: server.message_size_max,
      largeMessageCountMax: server.large_message_count_max ?? 4,
      random: this.random,
    });
  }

  receive(frame: Uint8Array, isForeign: boolean, now: number): Output[] {
    this.sessions.onFrame(frame, this.peer(isForeign), now);
    return this.outputs();
  }

  private peer(isForeign: boolean): { key: string; host: string } {
    return { key: `${this.connection}:${isForeign ? 2 : 1}`, host: `${this.connection}` };
  }

  act(step: Json, free: FreeBytes, now: number): Output[] {
    if (step.network_does === "disconnect") {
      this.sessions.endConnection(this.peer(false));
      this.connection += 1;
      return this.outputs();
    }
    switch (step.server_does) {
      case "wait":
        this.sessions.onTime(now);
        return this.outputs();
      case "stop":
        this.sessions.closeAll(now);
        return this.outputs();
      case "restart":
        this.running.clear();
        this.sessions = this.start(BigInt(step.epoch));
        this.drops = new DropWatch(this.sessions.counters);
        return [];
      default:
        return this.actOnCall(step, free, now);
    }
  }

  private actOnCall(step: Json, free: FreeBytes, now: number): Output[] {
    const callId = free.number(step.call_id);
    const request = this.running.get(callId);
    assert.ok(request !== undefined, `this call does not run: ${JSON.stringify(step)}`);
    if (step.server_does === "receipt") {
      this.sessions.accept(request, Status[step.status as StatusName], now);
      return this.outputs();
    }
    const payload = fromHex(step.payload);
    if (step.server_does === "item") {
      const taken = this.sessions.pushItem(request, payload, now);
      const seen = { no_credit: "no_credit", too_large: "item_too_large", gone: "no_credit" };
      const outputs = this.outputs();
      if (taken !== "taken") {
        outputs.push({ step: { server_sees: seen[taken], call_id: callId } });
      }
      return outputs;
    }
    assert.equal(step.server_does, "complete");
    this.running.delete(callId);
    this.sessions.complete(request, Status[step.status as StatusName], payload, now);
    return this.outputs();
  }

  private outputs(): Output[] {
    const outputs: Output[] = [];
    for (const { frame } of this.sessions.takeFrames()) outputs.push({ hex: toHex(frame) });
    for (const reason of this.drops.since()) outputs.push({ step: { server_counts: reason } });
    for (const event of this.sessions.takeEvents()) {
      if (event.kind === "hang_up") outputs.push({ step: { server_sees: "hang_up" } });
      if (event.kind === "run") outputs.push({ step: this.note(event.request) });
      if (event.kind !== "cancelled") continue;
      outputs.push({ step: { server_sees: "cancelled", call_id: event.request.header.callId } });
    }
    return outputs;
  }

  private note(request: Request): Json {
    const { header } = request;
    this.running.set(header.callId, request);
    return {
      server_sees: "run",
      call_id: header.callId,
      service: header.service,
      method: header.method,
      payload: toHex(request.payload),
      deadline_ns: request.deadline,
    };
  }
}

export class ClientSide implements Side {
  private readonly channel: ClientChannel;
  private readonly drops: DropWatch;
  private readonly calls = new Map<number, OpenCall>();
  private lost: readonly OpenCall[] = [];

  constructor(conversation: Json) {
    const { client } = conversation.setup;
    this.channel = new ClientChannel({
      medium: conversation.medium,
      clientEpoch: BigInt(client.epoch),
      channel: BigInt(client.channel),
      clockDomain: BigInt(client.clock_domain),
      messageSizeMax: client.message_size_max,
    });
    this.drops = new DropWatch(this.channel.counters);
  }

  receive(frame: Uint8Array, _isForeign: boolean, now: number): Output[] {
    this.channel.onFrame(frame, now);
    return this.outputs(now);
  }

  act(step: Json, free: FreeBytes, now: number): Output[] {
    if (step.network_does === "disconnect") {
      this.channel.reset();
      return [];
    }
    const call = step.call_id === undefined ? undefined : this.calls.get(free.number(step.call_id));
    switch (step.client_does) {
      case "wait":
        this.channel.onTime(now);
        break;
      case "cancel":
        this.channel.cancel(call!, now);
        break;
      case "take":
        return this.take(call!, now);
      case "close":
        this.channel.close(now);
        break;
      case "open":
        this.channel.open(step.priority, step.deadline_ns, now);
        break;
      default:
        return this.begin(step, now);
    }
    return this.outputs(now);
  }

  private begin(step: Json, now: number): Output[] {
    assert.equal(step.client_does, "call");
    const call = this.channel.call(
      {
        service: step.service,
        method: step.method,
        priority: step.priority,
        traceId: BigInt(step.trace_id),
        deadline: step.deadline_ns,
        delivery: step.delivery ?? "reply",
        streamWindow: step.window ?? 0,
      },
      fromHex(step.payload),
      now,
    );
    if (typeof call === "string") return [{ step: { client_sees: call } }];
    this.expectFree(call);
    this.calls.set(call.callId, call);
    return this.outputs(now);
  }

  // hp-4.3-2
  private expectFree(call: OpenCall): void {
    for (const open of this.calls.values()) {
      if (!open.isOpen) continue;
      const distance = (call.callId - open.callId) >>> 0;
      assert.notEqual(distance % (this.channel.welcome?.window ?? 1), 0);
    }
  }

  private take(call: OpenCall, now: number): Output[] {
    const outputs: Output[] = [];
    for (;;) {
      const item = this.channel.nextItem(call, now);
      if (item === undefined) break;
      outputs.push({
        step: { client_sees: "item", call_id: call.callId, payload: toHex(item) },
      });
    }
    return [...outputs, ...this.outputs(now)];
  }

  private outputs(now: number): Output[] {
    const outputs: Output[] = [];
    for (const frame of this.channel.takeFrames()) outputs.push({ hex: toHex(frame) });
    for (const event of this.channel.takeEvents()) {
      const step = this.stepOf(event);
      if (step !== undefined) outputs.push({ step });
      if (event.kind === "lost") this.lost = event.calls;
      if (event.kind === "ready") outputs.push(...this.judgeLost(now));
    }
    for (const reason of this.drops.since()) outputs.push({ step: { client_counts: reason } });
    return outputs;
  }

  // hp-5.5-2, hp-5.5-3
  private judgeLost(now: number): Output[] {
    const epoch = this.channel.welcome?.serverEpoch ?? 0n;
    const outputs = this.lost.map((call) => {
      const isSafe = hasNotRun(call.serverEpoch, epoch, call.begun, now);
      const seen = isSafe ? "not_run" : "may_have_run";
      return { step: { client_sees: seen, call_id: call.callId } };
    });
    this.lost = [];
    return outputs;
  }

  private stepOf(event: ChannelEvent): Json {
    switch (event.kind) {
      case "items": // taken when the vector says so
        return undefined;
      case "reply":
        return {
          client_sees: "result",
          call_id: event.call.callId,
          status: statusName(event.status),
          payload: toHex(event.payload),
        };
      case "refused":
        return { client_sees: "refused", status: statusName(event.status) };
      case "timeout":
        return event.call === undefined
          ? { client_sees: "timeout" }
          : { client_sees: "timeout", call_id: event.call.callId };
      default:
        return { client_sees: event.kind };
    }
  }
}

import { createSocket } from "node:dgram";
import { connect, createServer, type Socket } from "node:net";
import { createInterface } from "node:readline";
import { fromHex, toHex } from "../src/core/bytes.js";
import { ClientChannel, hasNotRun, type OpenCall } from "../src/core/client_channel.js";
import {
  readBindReply,
  readBindRequest,
  writeBindReply,
  writeBindRequest,
  writeTexts,
} from "../src/core/control.js";
import { Status, statusName, type Medium, type StatusName } from "../src/core/numbers.js";
import type { Peer } from "../src/core/peer.js";
import { ServerSessions, type Request } from "../src/core/server_sessions.js";
import { nodeAlgorithms } from "../src/node/algorithms.js";
import { nodeClock } from "../src/node/clock.js";
import { FrameReader } from "../src/client/frame_reader.js";

// The program under test of spec/conform/rtpm-conform: its line protocol on stdin and stdout.

type Values = Record<string, string>;
const now = (): number => nodeClock.now();
const say = (line: string): void => void process.stdout.write(`${line}\n`);
const counters = (dropped: ReadonlyMap<string, number>): string =>
  `counters ${[...dropped].map(([reason, count]) => `${reason}=${count}`).join(" ")}`;

interface Subject {
  does(words: string[], values: Values): void;
  dropped(): ReadonlyMap<string, number>;
}

class ServerSubject implements Subject {
  private readonly sessions: ServerSessions;
  private readonly calls = new Map<string, Request>();
  private readonly words = new Map<Request, string>();
  private readonly sockets = new Map<string, Socket>();
  private udpSend = (_frame: Uint8Array, _key: string): void => undefined;
  private timer = (): void => undefined;

  constructor(values: Values) {
    const medium = values["medium"] as Medium;
    const bands = values["bands"]!.split(",").map((band) => {
      const [low, high] = band.split("-").map(Number);
      return { low: low!, high: high! };
    });
    const largeCount = values["large_message_count_max"];
    this.sessions = new ServerSessions({
      medium,
      bands,
      epoch: BigInt(Date.now()),
      random: (bytes) => nodeAlgorithms.random(bytes),
      ceiling: Number(values["ceiling"]),
      clockDomain: BigInt(values["clock_domain"] ?? 0),
      sessionCountMax: Number(values["session_count_max"]),
      messageSizeMax: Number(values["message_size_max"]),
      ...(largeCount === undefined ? {} : { largeMessageCountMax: Number(largeCount) }),
    });
    const [host, port] = values["address"]!.split(":");
    if (medium === "datagram") this.serveUdp(host!, Number(port));
    else this.serveTcp(host!, Number(port));
  }

  private serveUdp(host: string, port: number): void {
    const socket = createSocket({ type: "udp4", recvBufferSize: 1 << 21 });
    socket.on("message", (frame, from) => {
      this.receive(frame, { key: `${from.address} ${from.port}`, host: from.address });
    });
    this.udpSend = (frame, key) => {
      const [address, to] = key.split(" ");
      socket.send(frame, Number(to), address);
    };
    socket.bind(port, host, () => say(`ready address=${host}:${socket.address().port}`));
  }

  private serveTcp(host: string, port: number): void {
    let count = 0;
    const server = createServer({ noDelay: true }, (socket) => {
      const peer = { key: `${++count}`, host };
      const reader = new FrameReader(false);
      this.sockets.set(peer.key, socket);
      socket.on("error", () => undefined);
      socket.on("data", (chunk) => {
        reader.read(chunk, (frame) => {
          this.receive(frame, peer);
          return !socket.destroyed;
        });
      });
      socket.on("close", () => {
        this.sessions.endConnection(peer);
        this.flush();
      });
    });
    server.listen(port, host, () => {
      const address = server.address();
      const bound = typeof address === "object" && address !== null ? address.port : port;
      say(`ready address=${host}:${bound}`);
    });
  }

  dropped(): ReadonlyMap<string, number> {
    return this.sessions.counters.dropped;
  }

  does(words: string[], values: Values): void {
    const [what, word = ""] = words;
    if (what === "stop") this.sessions.closeAll(now());
    const request = this.calls.get(word);
    const status = Status[values["status"] as StatusName] ?? 0;
    if (request !== undefined && what === "receipt") this.sessions.accept(request, status, now());
    if (request !== undefined && what === "item") {
      const taken = this.sessions.pushItem(request, fromHex(values["payload"] ?? ""), now());
      if (taken !== "taken")
        say(`sees ${taken === "too_large" ? "item_too_large" : "no_credit"} ${word}`);
    }
    if (request !== undefined && what === "complete") {
      this.sessions.complete(request, status, fromHex(values["payload"] ?? ""), now());
    }
    this.flush();
  }

  private receive(frame: Uint8Array, peer: Peer): void {
    this.sessions.onFrame(frame, peer, now());
    this.flush();
  }

  private flush(): void {
    for (const { frame, peer } of this.sessions.takeFrames()) {
      const socket = this.sockets.get(peer.key);
      if (socket === undefined) this.udpSend(frame, peer.key);
      else socket.write(frame);
    }
    for (const event of this.sessions.takeEvents()) {
      if (event.kind === "hang_up") this.sockets.get(event.peer.key)?.destroy();
      if (event.kind === "run") this.run(event.request);
      if (event.kind === "cancelled") say(`sees cancelled ${this.words.get(event.request)}`);
    }
    this.timer();
    const next = this.sessions.nextTime(now());
    if (next === Infinity) return;
    this.timer = nodeClock.at(next, () => {
      this.sessions.onTime(now());
      this.flush();
    });
  }

  private run(request: Request): void {
    const { header } = request;
    if (header.service === 0) {
      const asked = header.method === 1 ? readBindRequest(request.payload) : undefined;
      const methods = [{ id: 2, fingerprint: 0x22222222 }];
      const flags = { isServerDeclared: false, isMethodListComplete: true };
      const reply = { service: 1, priority: 0, fingerprint: 5n, methods, ...flags };
      let payload = asked === undefined ? new Uint8Array(0) : writeBindReply(reply);
      let status: number = Status.ok;
      if (header.method === 1 && asked === undefined) status = Status.bad_request;
      if (asked !== undefined && asked.interfaceName !== "lab.Arm") {
        status = Status.wrong_interface;
        payload = writeTexts(["lab.Arm"]);
      }
      if (asked !== undefined && asked.path !== "lab/arm0") {
        status = Status.no_such_object;
        payload = writeTexts(["lab/arm0"]);
      }
      this.sessions.complete(request, status, payload, now());
      this.flush();
      return;
    }
    const word = `c${this.calls.size + 1}`;
    this.calls.set(word, request);
    this.words.set(request, word);
    say(`sees run ${word} method=${header.method} payload=${toHex(request.payload)}`);
  }
}

class ClientSubject implements Subject {
  private readonly channel: ClientChannel;
  private readonly calls = new Map<string, OpenCall>();
  private readonly words = new Map<OpenCall, string>();
  private readonly binds = new Set<OpenCall>();
  private lost: readonly OpenCall[] = [];
  private send: ((frame: Uint8Array) => void) | undefined;
  private end = (): void => undefined;
  private timer = (): void => undefined;

  constructor(private readonly values: Values) {
    const medium = values["medium"] as Medium;
    this.channel = new ClientChannel({
      medium,
      clientEpoch: BigInt(Date.now()),
      channel: 1n,
      clockDomain: BigInt(values["clock_domain"] ?? 0),
      messageSizeMax: Number(values["message_size_max"]),
      handshakeNumber: Date.now() >>> 0,
    });
    if (medium === "stream") {
      say("ready");
      return;
    }
    const socket = createSocket({ type: "udp4", recvBufferSize: 1 << 21 });
    const [host, port] = values["address"]!.split(":");
    socket.on("message", (frame) => this.receive(frame));
    socket.on("error", () => undefined);
    socket.connect(Number(port), host, () => {
      this.send = (frame) => socket.send(frame, () => undefined);
      say(`ready address=127.0.0.1:${socket.address().port}`);
    });
  }

  dropped(): ReadonlyMap<string, number> {
    return this.channel.counters.dropped;
  }

  does(words: string[], values: Values): void {
    const [what, word = ""] = words;
    const deadline = now() + Number(values["timeout_us"] ?? 0) * 1000;
    const call = this.calls.get(word);
    if (what === "open") {
      if (this.send === undefined) this.connect();
      this.channel.open(Number(values["priority"]), deadline, now());
    } else if (what === "call") {
      this.begin(word, values, deadline);
    } else if (what === "bind") {
      this.bind(word, values, deadline);
    } else if (what === "take" && call !== undefined) {
      for (let item = this.channel.nextItem(call, now()); item !== undefined;) {
        say(`sees item ${word} payload=${toHex(item)}`);
        item = this.channel.nextItem(call, now());
      }
    } else if (what === "cancel" && call !== undefined) {
      this.channel.cancel(call, now());
    } else if (what === "close") {
      this.channel.close(now());
    } else {
      say(`cannot do ${what}`);
    }
    this.flush();
  }

  private connect(): void {
    const [host, port] = this.values["address"]!.split(":");
    const socket = connect({ host: host!, port: Number(port), noDelay: true });
    const reader = new FrameReader(false);
    this.send = (frame) => void socket.write(frame);
    this.end = () => socket.destroy();
    socket.on("error", () => undefined);
    socket.on("data", (chunk) => {
      reader.read(chunk, (frame) => {
        this.receive(frame);
        return !socket.destroyed;
      });
    });
    socket.on("close", () => {
      this.send = undefined;
      this.channel.reset();
      this.flush();
    });
  }

  private begin(word: string, values: Values, deadline: number): void {
    const call = this.channel.call(
      {
        service: Number(values["service"]),
        method: Number(values["method"]),
        priority: Number(values["priority"]),
        traceId: BigInt(values["trace_id"] ?? 0),
        deadline,
        delivery: (values["delivery"] ?? "reply") as "reply" | "receipt" | "sent",
        streamWindow: Number(values["window"] ?? 0),
      },
      fromHex(values["payload"] ?? ""),
      now(),
    );
    if (typeof call === "string") return say(`sees ${call} ${word}`);
    this.calls.set(word, call);
    this.words.set(call, word);
  }

  private bind(word: string, values: Values, deadline: number): void {
    const path = values["path"] ?? "";
    const interfaceName = values["interface"] ?? "";
    const fingerprint = BigInt(values["fingerprint"] ?? 0);
    const payload = toHex(writeBindRequest({ fingerprint, path, interfaceName }));
    this.begin(word, { ...values, service: "0", method: "1", payload }, deadline);
    const call = this.calls.get(word);
    if (call !== undefined) this.binds.add(call);
  }

  private receive(frame: Uint8Array): void {
    this.channel.onFrame(frame, now());
    this.flush();
  }

  private flush(): void {
    for (const frame of this.channel.takeFrames()) this.send?.(frame);
    for (const event of this.channel.takeEvents()) {
      if (event.kind === "ready") say("sees ready");
      if (event.kind === "refused") say(`sees refused status=${statusName(event.status)}`);
      if (event.kind === "closed" || event.kind === "broken") say(`sees ${event.kind}`);
      if (event.kind === "broken") this.end();
      if (event.kind === "lost") {
        this.lost = event.calls;
        say("sees lost");
      }
      if (event.kind === "ready") this.judgeLost();
      if (event.kind === "timeout") {
        say(
          event.call === undefined ? "sees timeout" : `sees timeout ${this.words.get(event.call)}`,
        );
      }
      if (event.kind === "reply") this.onReply(event.call, event.status, event.payload);
    }
    this.timer();
    const next = this.channel.nextTime();
    if (next === Infinity) return;
    this.timer = nodeClock.at(next, () => {
      this.channel.onTime(now());
      this.flush();
    });
  }

  private onReply(call: OpenCall, status: number, payload: Uint8Array): void {
    const word = this.words.get(call);
    if (!this.binds.has(call)) {
      return say(`sees result ${word} status=${statusName(status)} payload=${toHex(payload)}`);
    }
    const reply = status === Status.ok ? readBindReply(payload) : undefined;
    say(reply === undefined ? `sees bound ${word}` : `sees bound ${word} service=${reply.service}`);
  }

  // hp-5.5-2
  private judgeLost(): void {
    const epoch = this.channel.welcome?.serverEpoch ?? 0n;
    for (const call of this.lost) {
      const isSafe = hasNotRun(call.serverEpoch, epoch, call.begun, now());
      say(`sees ${isSafe ? "not_run" : "may_have_run"} ${this.words.get(call)}`);
    }
    this.lost = [];
  }
}

let subject: Subject | undefined;
for await (const line of createInterface({ input: process.stdin })) {
  const words: string[] = [];
  const values: Values = {};
  for (const part of line.trim().split(/\s+/)) {
    const at = part.indexOf("=");
    if (at < 0) words.push(part);
    else values[part.slice(0, at)] = part.slice(at + 1);
  }
  const verb = words.shift();
  if (verb === "quit") break;
  if (verb === "setup" && values["level"] === "bindings")
    say("cannot play bindings: see the unit tests");
  else if (verb === "setup")
    subject = values["role"] === "server" ? new ServerSubject(values) : new ClientSubject(values);
  else if (verb === "counters")
    say(subject === undefined ? "counters unknown" : counters(subject.dropped()));
  else if (verb === "does") subject?.does(words, values);
}
process.exit(0);

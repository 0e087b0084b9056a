import { createSocket, type Socket as UdpSocket } from "node:dgram";
import { randomFillSync } from "node:crypto";
import { createServer, isIPv6, type Server as TcpServer, type Socket } from "node:net";
import { viewOf } from "../core/bytes.js";
import type { FrameCounters } from "../core/counters.js";
import { messageSizeCeiling, priorityHighest, type Medium } from "../core/numbers.js";
import { shareOfOneHost, type Peer } from "../core/peer.js";
import { ServerSessions, type ServerEvent } from "../core/server_sessions.js";
import { hostInUrl, isValidPath } from "../core/url.js";
import type { KeyPair } from "../sealed/algorithms.js";
import { sealedPayloadMax } from "../sealed/frames.js";
import { SealedServer } from "../sealed/server.js";
import { Dispatcher } from "../server/dispatcher.js";
import { introspectionOf, introspectionPath } from "../server/introspection.js";
import type { Interface } from "../values/method.js";
import type { Skeleton } from "../values/skeleton.js";
import { nodeAlgorithms } from "./algorithms.js";
import { nodeClock, ownClockDomain } from "./clock.js";
import { FrameReader } from "../client/frame_reader.js";
import { writeTogether } from "./routes.js";

export interface ServerOptions {
  /** The address to serve, numeric; default 127.0.0.1. */
  readonly host?: string;
  /** The port for UDP and TCP; default 0, any free one. */
  readonly port?: number;
  /** Sessions over UDP, and connections over TCP, at a time; default 256 each. */
  readonly sessionCountMax?: number;
  /** Calls that run at a time, in all; further ones are refused with overload; default 1024. */
  readonly runningMax?: number;
  /** The largest request or reply in bytes; default 16 MiB. */
  readonly messageSizeMax?: number;
  /** Messages larger than a frame at a time, by UDP and TCP each; default 16. */
  readonly largeMessageCountMax?: number;
  readonly streamCountMax?: number;
  /** Calls above it are refused; default 32767. */
  readonly ceiling?: number;
  /** Seals sessions; then clients without an admitted key get none. */
  readonly keys?: {
    readonly own: KeyPair;
    readonly admits: (clientKey: Uint8Array) => boolean;
  };
  /** Serves `rtpm/introspection`, by which `rtpm call` and other tools work; default true. */
  readonly hasIntrospection?: boolean;
  /** Hears of exceptions of servants, which their callers see as servant_failed. */
  readonly onServantError?: (error: unknown, target: string) => void;
}

const firstFrameMs = 2000;
const silentConnectionMax = 64;
// Replies that a TCP client does not take; it is then disconnected.
const unsentMax = 32 * 1024 * 1024;
// Above it no more items of streams are written to a connection.
const itemsUnsentMax = 256 * 1024;

interface Connection {
  readonly socket: Socket;
  readonly peer: Peer;
  hasSpoken: boolean;
}

/** One medium's sessions, with their seal if there is one, and their timer. */
class Endpoint {
  readonly sessions: ServerSessions;
  private readonly sealed: SealedServer | undefined;
  private cancelTimer: (() => void) | undefined;
  private isClosed = false;

  constructor(
    medium: Medium,
    options: ServerOptions,
    epoch: bigint,
    private readonly onEvent: (endpoint: Endpoint, event: ServerEvent) => void,
    private readonly transmit: (frame: Uint8Array, peer: Peer) => void,
  ) {
    const { keys } = options;
    const sessionCountMax = options.sessionCountMax ?? 256;
    this.sessions = new ServerSessions({
      medium,
      epoch,
      random: (bytes) => randomFillSync(bytes),
      ceiling: options.ceiling ?? priorityHighest,
      clockDomain: ownClockDomain(),
      sessionCountMax,
      messageSizeMax: options.messageSizeMax ?? messageSizeCeiling,
      largeMessageCountMax: options.largeMessageCountMax ?? 16,
      streamCountMax: options.streamCountMax ?? 16,
      ...(keys === undefined ? {} : { framePayloadMax: sealedPayloadMax(medium) }),
    });
    if (keys === undefined) return;
    const { own, admits } = keys;
    this.sealed = new SealedServer(
      { algorithms: nodeAlgorithms, medium, own, admits, sessionCountMax },
      this.sessions,
    );
  }

  get counters(): FrameCounters[] {
    return [this.sessions.counters, ...(this.sealed === undefined ? [] : [this.sealed.counters])];
  }

  /** Returns true if the connection is to be ended. */
  receive(frame: Uint8Array, peer: Peer): boolean {
    if (this.isClosed) return true;
    const now = nodeClock.now();
    if (this.sealed === undefined) this.sessions.onFrame(frame, peer, now);
    const isBroken = this.sealed?.onFrame(frame, peer, now) ?? false;
    this.flush();
    return isBroken;
  }

  flush(): void {
    for (const { frame, peer } of this.sealed?.takeFrames() ?? []) this.transmit(frame, peer);
    for (const { frame, peer } of this.sessions.takeFrames()) {
      const sent = this.sealed === undefined ? frame : this.sealed.seal(frame);
      if (sent !== undefined) this.transmit(sent, peer);
    }
    for (const event of this.sessions.takeEvents()) this.onEvent(this, event);
    this.setTimer();
  }

  /** Ends the sessions of keys that are no longer admitted. */
  review(): void {
    this.sealed?.review(nodeClock.now());
    this.flush();
  }

  close(): void {
    this.sessions.closeAll(nodeClock.now());
    this.flush();
    this.isClosed = true;
    this.cancelTimer?.();
  }

  private setTimer(): void {
    this.cancelTimer?.();
    this.cancelTimer = undefined;
    const next = Math.min(
      this.sessions.nextTime(nodeClock.now()),
      this.sealed?.nextTime() ?? Infinity,
    );
    if (next === Infinity || this.isClosed) return;
    this.cancelTimer = nodeClock.at(next, () => {
      this.sessions.onTime(nodeClock.now());
      this.sealed?.onTime(nodeClock.now());
      this.flush();
    });
  }
}

/**
 * Serves objects over UDP and TCP at one port. Methods run on Node's one thread, so that they share
 * it with everything else; their priority is carried, but nothing is preempted.
 */
export class Server implements AsyncDisposable {
  private readonly dispatcher: Dispatcher;
  private readonly connections = new Map<string, Connection>();
  private connectionCount = 0;
  private udp: UdpSocket | undefined;
  private tcp: TcpServer | undefined;
  private readonly overUdp: Endpoint;
  private readonly overTcp: Endpoint;
  private boundPort = 0;

  private constructor(private readonly options: ServerOptions) {
    const epoch = viewOf(randomFillSync(new Uint8Array(8))).getBigUint64(0, true) | 1n;
    this.dispatcher = new Dispatcher({
      clock: nodeClock,
      runningMax: options.runningMax ?? 1024,
      onServantError:
        options.onServantError ?? ((error, target) => console.error(`rtpm: ${target}:`, error)),
    });
    if (options.hasIntrospection ?? true) {
      const others = (): (readonly [string, Interface])[] =>
        [...this.dispatcher.catalog()].filter(([path]) => path !== introspectionPath);
      this.dispatcher.add(introspectionPath, introspectionOf(others));
    }
    this.overUdp = new Endpoint("datagram", options, epoch, this.onEvent, (frame, peer) => {
      const at = peer.key.lastIndexOf(" ");
      this.udp?.send(frame, Number(peer.key.slice(at + 1)), peer.key.slice(0, at), () => undefined);
    });
    this.overTcp = new Endpoint("stream", options, epoch, this.onEvent, (frame, peer) => {
      this.transmitTcp(frame, peer);
    });
  }

  /** Opens the sockets. @throws Error if the address is in use */
  static async listen(options: ServerOptions = {}): Promise<Server> {
    const server = new Server(options);
    try {
      await server.open();
    } catch (error) {
      await server.close();
      throw error;
    }
    return server;
  }

  get port(): number {
    return this.boundPort;
  }
  /** The address of an object here: "rtpm://127.0.0.1:7421/lab/arm0". */
  addressOf(path: string): string {
    return `rtpm://${hostInUrl(this.host)}:${this.port}/${path}`;
  }
  /** How many frames were dropped, by their reasons. */
  get dropped(): ReadonlyMap<string, number> {
    const sum = new Map<string, number>();
    for (const counters of [...this.overUdp.counters, ...this.overTcp.counters]) {
      for (const [reason, count] of counters.dropped)
        sum.set(reason, (sum.get(reason) ?? 0) + count);
    }
    return sum;
  }

  /**
   * Serves an object under a path.
   * @throws RangeError for a text that is no path, or one that is served already
   */
  add(path: string, skeleton: Skeleton): void {
    if (!isValidPath(path)) throw new RangeError(`"${path}" is no path such as lab/arm0`);
    this.dispatcher.add(path, skeleton);
  }
  remove(path: string): void {
    this.dispatcher.remove(path);
  }
  /** Ends the sessions of keys that `keys.admits` no longer takes. */
  reviewKeys(): void {
    this.overUdp.review();
    this.overTcp.review();
  }

  /** Closes all sessions and sockets; servants that run are told by their signal. */
  async close(): Promise<void> {
    this.overUdp.close();
    this.overTcp.close();
    const { udp, tcp } = this;
    this.udp = this.tcp = undefined;
    for (const { socket } of this.connections.values()) {
      socket.end();
      socket.setTimeout(1000, () => socket.destroy());
    }
    await new Promise<void>((resolve) => (udp === undefined ? resolve() : udp.close(resolve)));
    await new Promise<void>((resolve) =>
      tcp?.listening === true ? tcp.close(() => resolve()) : resolve(),
    );
  }
  [Symbol.asyncDispose](): Promise<void> {
    return this.close();
  }

  private get host(): string {
    return this.options.host ?? "127.0.0.1";
  }

  // UDP and TCP under one number: a free one of TCP may be taken over UDP.
  private async open(): Promise<void> {
    for (let attempt = 0; ; attempt += 1) {
      this.boundPort = await this.openTcp(this.options.port ?? 0);
      try {
        await this.openUdp(this.boundPort);
        return;
      } catch (error) {
        this.tcp?.close();
        if ((this.options.port ?? 0) !== 0 || attempt === 10) throw error;
      }
    }
  }

  private openTcp(port: number): Promise<number> {
    const tcp = createServer({ noDelay: true }, (socket) => this.accept(socket));
    this.tcp = tcp;
    return new Promise((resolve, reject) => {
      tcp.once("error", reject);
      tcp.listen({ port, host: this.host }, () => {
        tcp.removeListener("error", reject);
        tcp.on("error", () => undefined); // of accepting: the next one may succeed
        const address = tcp.address();
        resolve(typeof address === "object" && address !== null ? address.port : port);
      });
    });
  }

  private openUdp(port: number): Promise<void> {
    const type = isIPv6(this.host) ? "udp6" : "udp4";
    const udp = createSocket({ type, recvBufferSize: 4 * 1024 * 1024 });
    return new Promise((resolve, reject) => {
      udp.once("error", (error) => {
        udp.close();
        reject(error);
      });
      udp.bind(port, this.host, () => {
        udp.removeAllListeners("error");
        udp.on("error", () => undefined); // ICMP errors of single clients
        udp.on("message", (frame, from) => {
          const key = `${from.address} ${from.port}`;
          this.overUdp.receive(frame, { key, host: hostOf(from.address) });
        });
        this.udp = udp;
        resolve();
      });
    });
  }

  // ---- connections -----------------------------------------------------------------------------

  private accept(socket: Socket): void {
    const host = hostOf(socket.remoteAddress ?? "");
    const key = `tcp ${++this.connectionCount}`;
    const connection: Connection = { socket, peer: { key, host }, hasSpoken: false };
    socket.on("error", () => undefined); // followed by `close`
    if (!this.makeSpace(host)) {
      this.turnAway(connection);
      return;
    }
    this.connections.set(key, connection);
    const reader = new FrameReader(this.options.keys !== undefined);
    socket.on("data", (chunk) => {
      const fault = reader.read(chunk, (frame) => {
        connection.hasSpoken = true;
        if (this.overTcp.receive(frame, connection.peer)) socket.destroy(); // sec-5-7
        return !socket.destroyed;
      });
      if (fault !== undefined) socket.destroy();
    });
    socket.on("drain", () => this.dispatcher.wakeStreams());
    socket.on("close", () => this.forget(connection));
    setTimeout(() => {
      if (!connection.hasSpoken) socket.destroy();
    }, firstFrameMs).unref();
  }

  private forget(connection: Connection): void {
    this.connections.delete(connection.peer.key);
    this.overTcp.sessions.endConnection(connection.peer);
    this.overTcp.flush();
  }

  // hp-4-7, hp-4-8
  private makeSpace(host: string): boolean {
    const all = [...this.connections.values()];
    const countMax = this.options.sessionCountMax ?? 256;
    const silent = all.filter((one) => !one.hasSpoken);
    if (silent.length >= silentConnectionMax) {
      const count = (one: Connection): number =>
        silent.filter((other) => other.peer.host === one.peer.host).length;
      const worst = silent.reduce((a, b) => (count(b) > count(a) ? b : a));
      worst.socket.destroy();
      this.forget(worst);
    }
    const ofHost = all.filter((one) => one.peer.host === host).length;
    return this.connections.size < countMax && ofHost < shareOfOneHost(countMax);
  }

  // Answers the first frame only: a HELLO with overload.
  private turnAway({ socket, peer }: Connection): void {
    const reader = new FrameReader(this.options.keys !== undefined);
    socket.setTimeout(firstFrameMs, () => socket.destroy());
    socket.once("data", (chunk) => {
      reader.read(chunk, (frame) => {
        this.overTcp.sessions.turnAway(frame, peer, nodeClock.now());
        for (const answer of this.overTcp.sessions.takeFrames()) socket.write(answer.frame);
        return false;
      });
      socket.end();
    });
  }

  private transmitTcp(frame: Uint8Array, peer: Peer): void {
    const socket = this.connections.get(peer.key)?.socket;
    if (socket === undefined || socket.destroyed) return;
    writeTogether(socket, frame);
    if (socket.writableLength > unsentMax) socket.destroy();
  }

  private readonly onEvent = (endpoint: Endpoint, event: ServerEvent): void => {
    if (event.kind === "hang_up") {
      this.connections.get(event.peer.key)?.socket.destroy();
      return;
    }
    const flush = (): void => endpoint.flush();
    const mayPush = (peer: Peer): boolean =>
      (this.connections.get(peer.key)?.socket.writableLength ?? 0) < itemsUnsentMax;
    this.dispatcher.onEvent({ sessions: endpoint.sessions, flush, mayPush }, event);
  };
}

// The addresses of one /64 are one host, and so are those of loopback (hp-4-7).
function hostOf(address: string): string {
  const plain = address.startsWith("::ffff:") ? address.slice(7) : address;
  if (plain.startsWith("127.") || plain === "::1") return "loopback";
  if (!isIPv6(plain)) return plain;
  const [head = "", tail = ""] = plain.split("%")[0]!.split("::");
  const left = head === "" ? [] : head.split(":");
  const right = tail === "" ? [] : tail.split(":");
  const zeros = new Array<string>(Math.max(8 - left.length - right.length, 0)).fill("0");
  return [...left, ...zeros, ...right].slice(0, 4).join(":");
}

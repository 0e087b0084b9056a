import { hasNotRun, type CallParameters } from "../core/client_channel.js";
import { Status, never, type Medium } from "../core/numbers.js";
import { Connection, type ConnectionConfig, type Outcome } from "./connection.js";
import { CallError } from "./errors.js";

/** A call without its session's parts. */
export interface Call {
  readonly parameters: Omit<CallParameters, "service" | "priority">;
  readonly priority: number;
  readonly payload: Uint8Array;
  readonly isIdempotent: boolean;
  readonly target: string;
  readonly signal?: AbortSignal | undefined;
  /** The object's number, under the epoch of the connection: bound again if need be (hp-6.1-4). */
  service(connection: Connection): Promise<number>;
}

const connectionMax = 16;

/** All channels to one server by one route: one for each lane that is called. */
export class ServerLink {
  private readonly connections: Connection[] = [];
  private isClosed = false;

  /** @param configOf  the configuration of the channel of that number, from 0 */
  constructor(
    private readonly medium: Medium,
    private readonly configOf: (number: number) => ConnectionConfig,
  ) {}

  /** How long the server keeps a stream without hearing of us: over TCP while connected. */
  get streamLease(): { streamLease?: number } {
    return this.medium === "stream" ? { streamLease: never } : {};
  }
  /** A connection that serves the priority now, if there is one. */
  readyConnection(priority: number): Connection | undefined {
    return this.connections.find((one) => one.serves(priority));
  }

  /** A connection whose session serves the priority. */
  async connectionFor(priority: number, deadline: number, target: string): Promise<Connection> {
    for (;;) {
      if (this.isClosed) throw new CallError("unreachable", target, "the node is closed", false);
      const ready = this.readyConnection(priority);
      if (ready !== undefined) return ready;
      const connection = this.unused() ?? this.add(target);
      await connection.open(priority, deadline, target);
      if (connection.serves(priority)) return connection;
    }
  }

  // A connection whose session ended, or is being opened.
  private unused(): Connection | undefined {
    return this.connections.find((one) => !one.channel.isReady);
  }

  private add(target: string): Connection {
    if (this.connections.length >= connectionMax) {
      throw new CallError("overload", target, `the server has more than ${connectionMax} lanes`);
    }
    const connection = new Connection(this.configOf(this.connections.length));
    this.connections.push(connection);
    return connection;
  }

  /**
   * Calls; where the session was lost, sends the call again in a new one if it has not run, or may
   * run twice (hp-5.5-2).
   */
  async call(call: Call): Promise<Outcome & { kind: "reply" }> {
    const { deadline } = call.parameters;
    for (;;) {
      const connection = await this.connectionFor(call.priority, deadline, call.target);
      const service = await call.service(connection);
      const parameters = { ...call.parameters, service, priority: call.priority };
      const outcome = await connection.call(parameters, call.payload, call.target, call.signal);
      if (outcome.kind !== "reply") {
        await this.judge(outcome, call);
      } else if (outcome.status === Status.cancelled && connection.now() >= deadline) {
        await this.judge({ kind: "timeout" }, call); // the server noticed it first
      } else {
        return outcome;
      }
    }
  }

  /** Returns if the call may be sent again; else throws why it failed. */
  async judge(outcome: Exclude<Outcome, { kind: "reply" }>, call: Call): Promise<void> {
    const { target } = call;
    switch (outcome.kind) {
      case "not_begun":
        if (outcome.reason === "wrong_band") return; // the session was replaced meanwhile
        throw new CallError("too_large", target, "the request is too large for the server", false);
      case "timeout":
        throw new CallError("timeout", target, "no answer came before the deadline");
      case "lost":
        if (outcome.epoch === 0n || (await this.maySendAgain(outcome, call))) return;
        throw new CallError("restarted", target, "the server lost the session; it may have run");
      case "closed":
        if (call.isIdempotent && !this.isClosed) return;
        throw new CallError("closed", target, "the server closed the session; it may have run");
      case "disconnected":
        if (call.isIdempotent && !this.isClosed) return;
        throw new CallError("disconnected", target, "the connection ended; it may have run");
    }
  }

  private async maySendAgain(outcome: Outcome & { kind: "lost" }, call: Call): Promise<boolean> {
    const { deadline } = call.parameters;
    const connection = await this.connectionFor(call.priority, deadline, call.target);
    const now = connection.now();
    const epoch = connection.epoch ?? 0n;
    return call.isIdempotent || hasNotRun(outcome.epoch, epoch, outcome.begun, now);
  }

  close(): void {
    this.isClosed = true;
    for (const connection of this.connections) connection.close();
  }
}

import {
  CommandMode,
  type Command,
  type Holder,
  type Lease,
  type Outcome,
  type Quaternion,
  type Vector3,
} from "../../idl/device.rtpm.js";
import type { Clock } from "../client/transport.js";
import { wrap } from "../core/bytes.js";
import { microsecond, millisecond } from "../core/numbers.js";
import type { CallOptions } from "../values/caller.js";
import { DeviceError, type Device } from "./device.js";

const zero: Vector3 = { x: 0, y: 0, z: 0 };
const upright: Quaternion = { x: 0, y: 0, z: 0, w: 1 };
const jointCount = 8;

/** A command's own fields; the others are zero, and the lease adds its number. */
export type CommandFields = Partial<Omit<Command, "lease" | "sequence" | "holdUs">> &
  Pick<Command, "mode">;

/**
 * The right to command a device. It is renewed until it is closed; without commands the device ends
 * it after some seconds all the same. Declare it with `await using`.
 *
 * A command holds for the time that it states: without a newer one the device then takes the force
 * away. So a program that stops, or pauses for longer, moves nothing.
 */
export class DeviceLease implements AsyncDisposable {
  /** For methods of `Device.client`. */
  readonly holder: Holder;
  private readonly ended = new AbortController();
  private readonly renewal: number;
  private sequence = 0;
  private cancelTimer = (): void => undefined;
  private troubleText = "";
  private isClosed = false;

  /** @internal */
  constructor(
    private readonly device: Device,
    lease: Lease,
    private readonly holdUsMax: number,
    private readonly clock: Clock,
  ) {
    this.holder = { lease: lease.id };
    this.renewal = Math.max((Number(lease.durationUs) / 3) * microsecond, millisecond);
    this.renewLater();
  }

  /** Aborted when the lease has ended: closed, expired or taken over. */
  get signal(): AbortSignal {
    return this.ended.signal;
  }
  /** Why the last renewal failed; empty if it did not. */
  get trouble(): string {
    return this.troubleText;
  }

  /**
   * Applies a force.
   * @param force  newton, in the device's frame
   * @param holdMs  for how long without a newer command; the device's limit shortens it
   */
  force(force: Vector3, holdMs: number, options?: CallOptions): Promise<void> {
    return this.command({ mode: CommandMode.Force, forceNewton: force }, holdMs, options);
  }

  /**
   * Moves to a pose.
   * @param position  metres, in the device's frame
   * @param holdMs  as of `force`
   */
  pose(
    position: Vector3,
    orientation: Quaternion,
    holdMs: number,
    options?: CallOptions,
  ): Promise<void> {
    const fields = { mode: CommandMode.Pose, positionM: position, orientation };
    return this.command(fields, holdMs, options);
  }

  /**
   * Commands the device.
   * @throws DeviceError if it refuses the command, and applies nothing of it; CallError if it does
   *   not answer within the schema's 10 ms or the stated deadline: send a newer one
   */
  async command(fields: CommandFields, holdMs: number, options?: CallOptions): Promise<void> {
    if (!(holdMs > 0)) throw new RangeError(`a command holds for more than 0 ms, not ${holdMs}`);
    this.sequence = wrap(this.sequence + 1);
    const command: Command = {
      forceNewton: zero,
      torqueNewtonMetre: zero,
      positionM: zero,
      orientation: upright,
      linearMPerS: zero,
      angularRadPerS: zero,
      joints: new Float64Array(jointCount),
      outputs: new Float32Array(jointCount),
      ...fields,
      lease: this.holder.lease,
      sequence: this.sequence,
      holdUs: Math.min(Math.ceil(holdMs * 1000), this.holdUsMax),
    };
    this.expectDone("command", await this.device.client.command(command, options));
  }

  /** Makes the device active. */
  async activate(options?: CallOptions): Promise<void> {
    this.expectDone("activate", await this.device.client.activate(this.holder, options));
  }
  /** Makes the device inactive, without force. */
  async deactivate(options?: CallOptions): Promise<void> {
    this.expectDone("deactivate", await this.device.client.deactivate(this.holder, options));
  }
  /** Clears a latched fault. */
  async recover(options?: CallOptions): Promise<void> {
    this.expectDone("recover", await this.device.client.recover(this.holder, options));
  }
  /** Ends an emergency stop. */
  async rearm(options?: CallOptions): Promise<void> {
    this.expectDone("rearm", await this.device.client.rearm(this.holder, options));
  }

  /** Releases the device: its force falls to zero. */
  async close(): Promise<void> {
    if (this.isClosed) return;
    this.isClosed = true;
    this.cancelTimer();
    try {
      if (!this.signal.aborted) await this.device.client.release(this.holder);
    } catch (error) {
      // The device ends it by itself.
      this.troubleText = error instanceof Error ? error.message : String(error);
    } finally {
      this.ended.abort();
    }
  }
  [Symbol.asyncDispose](): Promise<void> {
    return this.close();
  }

  private expectDone(method: string, outcome: Outcome): void {
    try {
      this.device.expectDone(method, outcome);
    } catch (error) {
      if (error instanceof DeviceError && error.outcome === "NotHolder") {
        this.cancelTimer();
        this.ended.abort(error);
      }
      throw error;
    }
  }

  private renewLater(): void {
    this.cancelTimer = this.clock.at(this.clock.now() + this.renewal, () => void this.renew());
  }

  private async renew(): Promise<void> {
    try {
      this.expectDone("renew", await this.device.client.renew(this.holder));
      this.troubleText = "";
    } catch (error) {
      this.troubleText = error instanceof Error ? error.message : String(error);
    }
    if (!this.isClosed && !this.signal.aborted) this.renewLater();
  }
}

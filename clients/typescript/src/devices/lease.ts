import {
  CommandMode,
  type Command,
  type Holder,
  type Lease,
  type Outcome,
  type Quaternion,
  type Sample,
  type Vector3,
} from "../../idl/device.rtpm.js";
import { pause, type Binder } from "../client/binder.js";
import { CallError } from "../client/errors.js";
import { wrap } from "../core/bytes.js";
import { microsecond, millisecond } from "../core/numbers.js";
import type { CallOptions } from "../values/caller.js";
import { DeviceError, type Device } from "./device.js";
import { Fault, Lifecycle, faultNames, lifecycleName } from "./fault.js";

const zero: Vector3 = { x: 0, y: 0, z: 0 };
const upright: Quaternion = { x: 0, y: 0, z: 0, w: 1 };
const jointCount = 8;

const showInterval = 2 * millisecond;
const showMsMax = 500;

/** A command's own fields; the others are zero, and the lease adds its number. */
export type CommandFields = Partial<Omit<Command, "lease" | "sequence" | "holdUs">> &
  Pick<Command, "mode">;

/**
 * The right to command a device. It is renewed until it or its node is closed; without commands the
 * device ends it after some seconds all the same. Declare it with `await using`.
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
  private readonly disown: () => void;

  /** @internal */
  constructor(
    private readonly device: Device,
    lease: Lease,
    private readonly holdUsMax: number,
    private readonly binder: Binder,
  ) {
    this.holder = { lease: lease.id };
    this.renewal = Math.max((Number(lease.durationUs) / 3) * microsecond, millisecond);
    this.renewLater();
    this.disown = binder.own(this);
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
   * Applies a force. It resolves when the device has the command, also where a fault is latched
   * (too fast, or an earlier command with a NaN) and no force comes until recover(): only
   * `faults` of the samples shows that, as it shows a force above the device's limits, which the
   * device shortens.
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

  // The device takes these up in a later cycle.

  /** Makes the device active. @throws CallError, timeout if no sample shows it within 500 ms */
  async activate(options?: CallOptions): Promise<void> {
    this.expectDone("activate", await this.device.client.activate(this.holder, options));
    const isActive = ({ lifecycle }: Sample): boolean => lifecycle === Lifecycle.Active;
    await this.untilShown("activate", isActive, options);
  }
  /** Makes the device inactive, without force. @throws CallError as activate() */
  async deactivate(options?: CallOptions): Promise<void> {
    this.expectDone("deactivate", await this.device.client.deactivate(this.holder, options));
    const isInactive = ({ lifecycle }: Sample): boolean => lifecycle === Lifecycle.Inactive;
    await this.untilShown("deactivate", isInactive, options);
  }
  /** Clears a latched fault. @throws CallError, timeout if samples show it for 500 ms more */
  async recover(options?: CallOptions): Promise<void> {
    this.expectDone("recover", await this.device.client.recover(this.holder, options));
    const latched = Fault.CommandNotFinite | Fault.TooFast;
    await this.untilShown("recover", ({ faults }) => (faults & latched) === 0, options);
  }
  /** Ends an emergency stop. @throws CallError, timeout if samples show it for 500 ms more */
  async rearm(options?: CallOptions): Promise<void> {
    this.expectDone("rearm", await this.device.client.rearm(this.holder, options));
    const stop = Fault.EmergencyStop;
    await this.untilShown("rearm", ({ faults }) => (faults & stop) === 0, options);
  }

  /** Releases the device: its force falls to zero. */
  async close(): Promise<void> {
    if (this.isClosed) return;
    this.isClosed = true;
    this.cancelTimer();
    this.disown();
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
        this.disown();
        this.ended.abort(error);
      }
      throw error;
    }
  }

  private async untilShown(
    method: string,
    isShown: (sample: Sample) => boolean,
    options: CallOptions = {},
  ): Promise<void> {
    const { clock } = this.binder;
    const call = options.signal === undefined ? {} : { signal: options.signal };
    const end = clock.now() + showMsMax * millisecond;
    // The cycle that runs now may have begun before.
    const sequenceMin = (await this.device.read(call)).sequence + 2n;
    for (;;) {
      await pause(clock, showInterval, options.signal);
      const sample = await this.device.read(call);
      if (sample.sequence >= sequenceMin && isShown(sample)) return;
      if (clock.now() < end) continue;
      const shown = [lifecycleName(sample.lifecycle), ...faultNames(sample.faults)].join(", ");
      const detail =
        `the device took it, but after ${showMsMax} ms its samples show: ${shown}. ` +
        "Remedy: end the cause, and call it again";
      throw new CallError("timeout", `${this.device.name}.${method}`, detail, true);
    }
  }

  private renewLater(): void {
    const { clock } = this.binder;
    this.cancelTimer = clock.at(clock.now() + this.renewal, () => void this.renew());
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

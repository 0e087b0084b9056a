import {
  DeviceClient,
  DeviceInterface,
  OutcomeCode,
  StopScope,
  type Description,
  type Outcome,
  type Sample,
} from "../../idl/device.rtpm.js";
import { pause, type Binder } from "../client/binder.js";
import { millisecond } from "../core/numbers.js";
import type { CallOptions } from "../values/caller.js";
import { DeviceLease } from "./lease.js";

/** A refusal of a device; it did nothing of what was asked. */
export class DeviceError extends Error {
  override readonly name = "DeviceError";

  constructor(
    /** A name of OutcomeCode, "Held". */
    readonly outcome: string,
    detail: string,
  ) {
    super(detail);
  }
}

const outcomeNames = new Map<number, string>(
  Object.entries(OutcomeCode).map(([name, code]) => [code, name]),
);
const remedies = new Map<number, string>([
  [OutcomeCode.NotHolder, ": the lease has ended; acquire it again"],
  [OutcomeCode.Held, ": another client has the lease; acquire({ patienceMs }) waits for it"],
  [OutcomeCode.EmergencyStop, ": rearm() ends the stop"],
  [OutcomeCode.NotActive, ": activate() makes it active"],
  [OutcomeCode.NotFinite, ": the force is off until recover()"],
  [OutcomeCode.WrongMode, ": the device does not have this mode; see description.modes"],
]);

export interface AcquireOptions {
  /** How long to wait while another client has the lease; default 0. */
  readonly patienceMs?: number;
  readonly signal?: AbortSignal;
}

export interface SampleOptions {
  /** The pause between two readings, which samples in between fall into; default 10. */
  readonly intervalMs?: number;
  /** Ends the samples. */
  readonly signal?: AbortSignal;
}

// A device grants a lease at most every 100 ms.
const acquireInterval = 50 * millisecond;
// The schema's 10 ms are for loops, and shorter than some pauses of JavaScript.
const readDeadlineMs = 1000;

/** A device of the laboratory: its samples, the right to command it, and its emergency stop. */
export class Device {
  private constructor(
    /** The name or address that it was opened by. */
    readonly name: string,
    /** All of its methods, with outcomes as numbers. */
    readonly client: DeviceClient,
    private readonly binder: Binder,
  ) {}

  /**
   * Opens a device.
   * @param name  "lab/arm0", or its address
   * @throws CallError or NameError if it cannot be bound
   */
  static async open(binder: Binder, name: string, options: CallOptions = {}): Promise<Device> {
    const binding = await binder.bind(name, DeviceInterface, options);
    return new Device(name, new DeviceClient(binding), binder);
  }

  /** Its axes, limits and units. */
  describe(options?: CallOptions): Promise<Description> {
    return this.client.describe(options);
  }

  /** Its newest sample; sequence 0n: it has none yet. */
  async read(options: CallOptions = {}): Promise<Sample> {
    return await this.client.read({ deadlineMs: readDeadlineMs, ...options });
  }

  /**
   * The newest sample again and again, each once, until the loop is left.
   * @throws CallError if the device does not answer; the signal's reason
   */
  async *samples(options: SampleOptions = {}): AsyncGenerator<Sample, void> {
    const { signal, intervalMs = 10 } = options;
    const { clock } = this.binder;
    let last: bigint | undefined;
    for (;;) {
      const begun = clock.now();
      const sample = await this.read(signal === undefined ? {} : { signal });
      if (sample.sequence !== last && sample.sequence !== 0n) yield sample;
      last = sample.sequence;
      const left = begun + intervalMs * millisecond - clock.now();
      await pause(clock, Math.max(left, 0), signal);
    }
  }

  /**
   * Acquires the right to command the device. Until the lease or its node is closed it is renewed.
   * @throws DeviceError, Held if another client kept it
   */
  async acquire(options: AcquireOptions = {}): Promise<DeviceLease> {
    const { clock } = this.binder;
    const { signal, patienceMs = 0 } = options;
    const call = signal === undefined ? {} : { signal };
    const end = clock.now() + patienceMs * millisecond;
    const { holdUsMax } = await this.client.describe(call);
    for (;;) {
      const lease = await this.client.acquire(call);
      if (lease.outcome === OutcomeCode.Done) {
        return new DeviceLease(this, lease, holdUsMax, this.binder);
      }
      const mayChange = lease.outcome === OutcomeCode.Held || lease.outcome === OutcomeCode.TooSoon;
      if (!mayChange || clock.now() >= end) throw this.errorOf("acquire", lease.outcome);
      await pause(clock, acquireInterval, signal);
    }
  }

  /** Takes the force of the device away at once, until it is rearmed. Needs no lease. */
  async emergencyStop(options?: CallOptions): Promise<void> {
    const stop = { scope: StopScope.Device };
    this.expectDone("emergency_stop", await this.client.emergencyStop(stop, options));
  }

  /** @internal */
  expectDone(method: string, { code }: Outcome): void {
    if (code !== OutcomeCode.Done) throw this.errorOf(method, code);
  }

  private errorOf(method: string, code: number): DeviceError {
    const outcome = outcomeNames.get(code) ?? `outcome ${code}`;
    const remedy = remedies.get(code) ?? "";
    return new DeviceError(outcome, `${this.name}: ${method}: ${outcome}${remedy}`);
  }
}

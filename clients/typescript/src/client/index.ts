// Nodes of all kinds export this.
export type { Binder } from "./binder.js";
export { Binding } from "./binding.js";
export { CallingNode, type CallingOptions } from "./calling_node.js";
export { Directory, NameError, Registration, type BindNameOptions } from "./directory.js";
export { CallError, type CallErrorCode } from "./errors.js";
export type { StatusName } from "../core/numbers.js";
export { parseUrl, type Url } from "../core/url.js";
export { Device, DeviceError, type AcquireOptions, type SampleOptions } from "../devices/device.js";
export { Fault, Lifecycle, faultNames, lifecycleName } from "../devices/fault.js";
export { DeviceLease, type CommandFields } from "../devices/lease.js";
export { EventConsumer, type EventConsumerOptions } from "../events/consumer.js";
export { HubEvent } from "../events/event.js";
export { EventFilter, type Comparison } from "../events/filter.js";
export { EventSupplier } from "../events/supplier.js";
export * from "../values/index.js";

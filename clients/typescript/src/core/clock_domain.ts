import { fnv1a64, utf8 } from "./bytes.js";

/**
 * The clock_domain of a host (hp-4.1-7), for a side that reads CLOCK_MONOTONIC of Linux.
 * @param bootId  the content of /proc/sys/kernel/random/boot_id
 * @param timeNamespace  the text of the link /proc/self/ns/time, empty if there is none
 */
export function clockDomainOf(bootId: string, timeNamespace: string): bigint {
  return fnv1a64(utf8.encode(bootId + timeNamespace));
}

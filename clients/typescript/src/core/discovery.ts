import { isZero, viewOf } from "./bytes.js";

/** A datagram of discovery on the LAN (spec/hprotocol.md, 10.1). */
export interface Discovery {
  readonly kind: "query" | "answer";
  readonly domain: number;
  readonly number: bigint;
  readonly services: readonly DiscoveredService[];
}
export interface DiscoveredService {
  readonly port: number;
  readonly isRegistry: boolean;
  /** 0 if it is not told. */
  readonly processId: number;
}

const size = 256;
const serviceCountMax = 30;
const magic = 0x44505452; // "RTPD" in reading order

/** @throws RangeError for more than 30 services */
export function writeDiscovery(message: Discovery): Uint8Array {
  if (message.services.length > serviceCountMax) {
    throw new RangeError(`a datagram of discovery has at most ${serviceCountMax} services`);
  }
  const bytes = new Uint8Array(size);
  const view = viewOf(bytes);
  view.setUint32(0, magic, true);
  view.setUint8(4, 1);
  view.setUint8(5, message.kind === "query" ? 1 : 2);
  view.setUint8(6, message.domain);
  view.setUint8(7, message.services.length);
  view.setBigUint64(8, message.number, true);
  message.services.forEach((service, i) => {
    view.setUint16(16 + 8 * i, service.port, true);
    view.setUint8(18 + 8 * i, service.isRegistry ? 1 : 2);
    view.setUint32(20 + 8 * i, service.processId, true);
  });
  return bytes;
}

/** undefined if it is to be dropped (hp-10.1-2). */
export function readDiscovery(bytes: Uint8Array): Discovery | undefined {
  if (bytes.length !== size) return undefined;
  const view = viewOf(bytes);
  const kind = view.getUint8(5);
  const count = view.getUint8(7);
  const isGood =
    view.getUint32(0, true) === magic &&
    view.getUint8(4) === 1 &&
    (kind === 1 || kind === 2) &&
    count <= (kind === 1 ? 0 : serviceCountMax) &&
    isZero(bytes.subarray(16 + 8 * count));
  if (!isGood) return undefined;
  const services: DiscoveredService[] = [];
  for (let at = 16; at < 16 + 8 * count; at += 8) {
    const port = view.getUint16(at, true);
    const serviceKind = view.getUint8(at + 2);
    if (port === 0 || serviceKind < 1 || serviceKind > 2 || view.getUint8(at + 3) !== 0) {
      return undefined;
    }
    const processId = view.getUint32(at + 4, true);
    services.push({ port, isRegistry: serviceKind === 1, processId });
  }
  return {
    kind: kind === 1 ? "query" : "answer",
    domain: view.getUint8(6),
    number: view.getBigUint64(8, true),
    services,
  };
}

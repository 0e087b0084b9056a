/** The binary frames of the Foxglove WebSocket protocol: an opcode, then little-endian fields. */

export interface MessageData {
  readonly kind: 'message';
  readonly subscriptionId: number;
  readonly timeNs: bigint;
  readonly payload: Uint8Array;
}

export interface ServiceResponse {
  readonly kind: 'response';
  readonly callId: number;
  readonly encoding: string;
  readonly payload: Uint8Array;
}

export type Frame = MessageData | ServiceResponse | {readonly kind: 'other'};

const kMessageData = 1;
const kServiceResponse = 3;
const kServiceRequest = 2;

/** Throws RangeError where the frame is cut short. */
export function readFrame(bytes: Uint8Array): Frame {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  switch (view.getUint8(0)) {
    case kMessageData:
      return {
        kind: 'message',
        subscriptionId: view.getUint32(1, true),
        timeNs: view.getBigUint64(5, true),
        payload: bytes.subarray(13),
      };
    case kServiceResponse: {
      const size = view.getUint32(9, true);
      if (13 + size > bytes.length) throw new RangeError('a reply is cut short');
      return {
        kind: 'response',
        callId: view.getUint32(5, true),
        encoding: new TextDecoder().decode(bytes.subarray(13, 13 + size)),
        payload: bytes.subarray(13 + size),
      };
    }
    default:
      return {kind: 'other'};
  }
}

export function writeRequest(serviceId: number, callId: number, request: string): Uint8Array {
  const encoding = new TextEncoder().encode('json');
  const payload = new TextEncoder().encode(request);
  const bytes = new Uint8Array(13 + encoding.length + payload.length);
  const view = new DataView(bytes.buffer);
  view.setUint8(0, kServiceRequest);
  view.setUint32(1, serviceId, true);
  view.setUint32(5, callId, true);
  view.setUint32(9, encoding.length, true);
  bytes.set(encoding, 13);
  bytes.set(payload, 13 + encoding.length);
  return bytes;
}

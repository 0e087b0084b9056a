import {Bytes} from '../flatbuffers/bytes';

/** A camera, as console/state has it. */
export interface Medium {
  readonly name: string;
  readonly widthPx: number;
  readonly heightPx: number;
  readonly rateHz: number;
  readonly uncertaintyNs: number;
  readonly problem: string;
}

/** The vtable's offset of `data` in foxglove.CompressedVideo and foxglove.CompressedImage. */
const kDataOffset = 8;

/** The picture of such a message. Throws RangeError where it is broken. */
export function pictureIn(message: Uint8Array): Uint8Array {
  const bytes = new Bytes(message);
  const field = bytes.field(bytes.root(), kDataOffset);
  if (field === 0) throw new RangeError('a picture is missing');
  const {start, count} = bytes.vector(field, 1);
  return message.subarray(start, start + count);
}

const kKeySlice = 5;
const kSequenceParameters = 7;

/**
 * The needs of a picture in Annex B: whether it can be decoded without earlier ones, and for a key
 * frame the codec's name for WebCodecs, "avc1.42c01e".
 */
export function inspect(annexB: Uint8Array): {isKey: boolean; codec: string} {
  let isKey = false;
  let codec = '';
  for (let i = 0; i + 6 < annexB.length; ++i) {
    if (annexB[i] !== 0 || annexB[i + 1] !== 0 || annexB[i + 2] !== 1) continue;
    const kind = (annexB[i + 3] ?? 0) & 31;
    if (kind === kKeySlice) isKey = true;
    if (kind === kSequenceParameters) {
      const hex = [...annexB.subarray(i + 4, i + 7)].map((one) => one.toString(16).padStart(2, '0'));
      codec = `avc1.${hex.join('')}`;
    }
    i += 3;
    if (isKey) break;
  }
  return {isKey, codec};
}

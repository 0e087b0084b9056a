import { concat, plainBytes } from "../core/bytes.js";
import { headerSize, type DropReason } from "../core/numbers.js";
import { frameSizeOf } from "../sealed/frames.js";

/** Cuts what comes over a connection into frames, sealed or not; keeps one frame at most. */
export class FrameReader {
  private rest: Uint8Array = new Uint8Array(0);

  /** @param takesSealed  whether the receiver has level S */
  constructor(private readonly takesSealed: boolean) {}

  /**
   * Takes the next bytes, and gives `take` each frame that is whole.
   * @param take  false ends the reading, as the connection was ended
   * @returns the reason if what follows is no frame (hp-8-2)
   */
  read(chunk: Uint8Array, take: (frame: Uint8Array) => boolean): DropReason | undefined {
    let bytes = this.rest.length === 0 ? plainBytes(chunk) : concat(this.rest, chunk);
    this.rest = new Uint8Array(0);
    while (bytes.length >= headerSize) {
      const size = frameSizeOf(bytes.subarray(0, headerSize), "stream", this.takesSealed);
      if (typeof size === "string") {
        // The receiver judges and counts it by itself.
        take(bytes.subarray(0, headerSize));
        return size;
      }
      if (bytes.length < size) break;
      if (!take(bytes.subarray(0, size))) return undefined;
      bytes = bytes.subarray(size);
    }
    this.rest = bytes.slice();
    return undefined;
  }
}

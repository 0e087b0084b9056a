import {texts} from '../texts/texts';
import {signal, type Signal} from '@preact/signals';
import {inspect, pictureIn} from '../model/picture';
import type {Message} from '../protocol/client';
import type {Link} from './link';

/** Pictures that wait for the decoder beyond it are old: it goes on with the next key frame. */
const kWaitingMax = 3;

/** Shows one camera on a canvas while it is open: the newest picture, never an old one. */
export class Camera {
  /** Why there is no picture; empty if there is one. */
  readonly problem: Signal<string> = signal('');
  /** When the picture on the canvas was captured, by the console's clock; null before the first. */
  captureNs: bigint | null = null;
  private decoder: VideoDecoder | null = null;
  private codec = '';
  private needsKey = true;
  /** The JPEG picture that is being decoded, and the newest that waits for it. */
  private isBusy = false;
  private next: {picture: Uint8Array; timeNs: bigint} | null = null;
  private readonly end: () => void;

  constructor(
    link: Link,
    readonly name: string,
    private readonly canvas: HTMLCanvasElement,
  ) {
    this.end = link.subscribe(`${name}/video`, (message) => this.take(message));
  }

  close(): void {
    this.end();
    this.reset();
  }

  private take(message: Message): void {
    const picture = pictureIn(message.payload);
    if (message.channel.schemaName === 'foxglove.CompressedImage') {
      this.next = {picture: picture.slice(), timeNs: message.timeNs};
      if (!this.isBusy) void this.showImages();
    } else {
      this.decode(picture, message.timeNs);
    }
  }

  private async showImages(): Promise<void> {
    this.isBusy = true;
    while (this.next !== null) {
      const {picture, timeNs} = this.next;
      this.next = null;
      try {
        const image = await createImageBitmap(new Blob([picture as BlobPart]));
        this.draw(image, image.width, image.height, timeNs);
        image.close();
      } catch {
        this.problem.value = 'a picture is no JPEG';
      }
    }
    this.isBusy = false;
  }

  private decode(picture: Uint8Array, timeNs: bigint): void {
    const {isKey, codec} = inspect(picture);
    if (isKey && codec !== '' && codec !== this.codec) this.open(codec);
    if (this.decoder === null) return;
    if (!isKey && (this.needsKey || this.decoder.decodeQueueSize >= kWaitingMax)) {
      this.needsKey = true;
      return;
    }
    this.needsKey = false;
    this.decoder.decode(
      new EncodedVideoChunk({
        type: isKey ? 'key' : 'delta',
        // The clock's microseconds come back with the decoded picture.
        timestamp: Number(timeNs / 1000n),
        data: picture,
      }),
    );
  }

  private open(codec: string): void {
    this.reset();
    if (typeof VideoDecoder === 'undefined') {
      this.problem.value = texts.value.cameras.insecure;
      return;
    }
    this.codec = codec;
    this.decoder = new VideoDecoder({
      output: (frame) => {
        this.draw(frame, frame.displayWidth, frame.displayHeight, BigInt(frame.timestamp) * 1000n);
        frame.close();
      },
      error: (error) => {
        this.problem.value = texts.value.cameras.undecodable(codec, error.message);
        this.reset();
      },
    });
    // Without a description the decoder takes Annex B.
    this.decoder.configure({codec, optimizeForLatency: true});
  }

  private reset(): void {
    if (this.decoder !== null && this.decoder.state !== 'closed') this.decoder.close();
    this.decoder = null;
    this.codec = '';
    this.needsKey = true;
  }

  private draw(image: CanvasImageSource, width: number, height: number, timeNs: bigint): void {
    const {canvas} = this;
    if (canvas.width !== width) canvas.width = width;
    if (canvas.height !== height) canvas.height = height;
    canvas.getContext('2d')?.drawImage(image, 0, 0);
    canvas.dataset['captureNs'] = String(timeNs);
    this.captureNs = timeNs;
    this.problem.value = '';
  }
}

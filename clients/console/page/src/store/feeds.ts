import {effect, signal, type ReadonlySignal} from '@preact/signals';
import {feedOf, type Feed} from '../model/names';
import type {Channel, Message} from '../protocol/client';
import type {Link} from './link';
import type {Motion} from './motion';

const kReplay = 'replay/';

/** The console may have a device's samples twice: by its name, and by its source. */
function isRepeated(topic: string, feed: Feed, channels: ReadonlyMap<string, Channel>): boolean {
  const named = `${topic.startsWith(kReplay) ? kReplay : ''}${feed.device}/sample`;
  return feed.kind === 'sample' && topic !== named && channels.has(named);
}

/**
 * Subscribes to the samples and touches that the page shows: of the live system, and of a recording
 * while one is open. A hidden page takes neither.
 */
export class Feeds {
  private readonly ends = new Map<string, () => void>();
  private readonly isVisible = signal(true);

  constructor(
    private readonly link: Link,
    private readonly live: Motion,
    private readonly replay: Motion,
    private readonly names: ReadonlySignal<readonly string[]>,
    private readonly nowMs: () => number,
  ) {
    effect(() => this.follow(this.link.channels.value, this.names.value, this.isVisible.value));
  }

  setVisible(isVisible: boolean): void {
    this.isVisible.value = isVisible;
  }

  private follow(
    channels: ReadonlyMap<string, Channel>,
    names: readonly string[],
    isVisible: boolean,
  ): void {
    const wanted = new Set<string>();
    if (isVisible) {
      for (const topic of channels.keys()) {
        const isReplay = topic.startsWith(kReplay);
        const feed = feedOf(isReplay ? topic.slice(kReplay.length) : topic, names);
        if (feed === null || isRepeated(topic, feed, channels)) continue;
        // The source's number is known to be a device's as soon as the device is.
        const key = `${topic}\n${feed.device}`;
        wanted.add(key);
        if (!this.ends.has(key)) this.ends.set(key, this.take(topic, feed, isReplay));
      }
    }
    for (const [key, end] of this.ends) {
      if (wanted.has(key)) continue;
      end();
      this.ends.delete(key);
    }
  }

  private take(topic: string, feed: Feed, isReplay: boolean): () => void {
    const motion = isReplay ? this.replay : this.live;
    return this.link.subscribe(topic, (message: Message) => {
      const track = motion.trackFor(feed.device);
      if (feed.kind === 'sample') track?.takeSample(message, this.nowMs());
      else track?.takeTouch(message, this.nowMs());
    });
  }
}

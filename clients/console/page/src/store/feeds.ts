import {effect, signal, type ReadonlySignal} from '@preact/signals';
import {feedOf, type Feed} from '../model/names';
import type {Channel, Message} from '../protocol/client';
import type {Link} from './link';
import {kTrackMax, type Motion} from './motion';

const kReplay = 'replay/';

/** The console may have a device's samples twice: by its name, and by its source. */
function isRepeated(topic: string, feed: Feed, channels: ReadonlyMap<string, Channel>): boolean {
  const named = `${topic.startsWith(kReplay) ? kReplay : ''}${feed.device}/sample`;
  return feed.kind === 'sample' && topic !== named && channels.has(named);
}

/**
 * Subscribes to the samples and touches that the page shows: of as many devices of the live system
 * as have tracks, and of a recording while one is open. A hidden page takes neither.
 */
export class Feeds {
  private readonly ends = new Map<string, () => void>();
  private readonly isVisible = signal(true);

  constructor(
    private readonly link: Link,
    private readonly live: Motion,
    private readonly replay: Motion,
    private readonly names: ReadonlySignal<readonly string[]>,
    /** The device that a view shows: it always has a track. */
    private readonly subject: ReadonlySignal<string>,
    private readonly nowMs: () => number,
  ) {
    effect(() =>
      this.follow(
        this.link.channels.value,
        this.names.value,
        this.subject.value,
        this.isVisible.value,
      ),
    );
  }

  setVisible(isVisible: boolean): void {
    this.isVisible.value = isVisible;
  }

  private follow(
    channels: ReadonlyMap<string, Channel>,
    names: readonly string[],
    subject: string,
    isVisible: boolean,
  ): void {
    const wanted = new Set<string>();
    const followed = this.followed(names, subject);
    if (isVisible) {
      for (const topic of channels.keys()) {
        const isReplay = topic.startsWith(kReplay);
        const feed = feedOf(isReplay ? topic.slice(kReplay.length) : topic, names);
        if (feed === null || isRepeated(topic, feed, channels)) continue;
        if (!isReplay && names.includes(feed.device) && !followed.has(feed.device)) continue;
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

  /** The shown device, and the first others; the tracks of devices beyond give way. */
  private followed(names: readonly string[], subject: string): ReadonlySet<string> {
    const ordered = names.includes(subject) ? [subject, ...names] : names;
    const kept = new Set([...new Set(ordered)].slice(0, kTrackMax));
    for (const name of this.live.names()) {
      if (names.includes(name) && !kept.has(name)) this.live.drop(name);
    }
    return kept;
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

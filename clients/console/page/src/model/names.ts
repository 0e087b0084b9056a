/** RTPM's number of a device as a source of events: the 32-bit FNV-1a hash of its name's bytes. */
export function sourceOf(name: string): number {
  let hash = 0x811c9dc5;
  for (const byte of new TextEncoder().encode(name)) {
    hash = Math.imul(hash ^ byte, 0x01000193) >>> 0;
  }
  return hash;
}

const kSamples = /^(?:(.+)\/sampled?|rtpm\.device\.Sampled\/(\d+))$/;
const kTouches = /^rtpm\.touch\.Touched\/(\d+)$/;

export type Feed = {readonly kind: 'sample' | 'touch'; readonly device: string};

/**
 * The device and kind of a topic: `NAME/sample` of the console and `NAME/sampled` of a recording by
 * their name, `TYPE/SOURCE` by the source of a known name. A source without one is called by number.
 */
export function feedOf(topic: string, names: readonly string[]): Feed | null {
  const bySource = (source: string | undefined) =>
    names.find((name) => String(sourceOf(name)) === source) ?? `source ${source}`;
  const samples = kSamples.exec(topic);
  if (samples !== null) {
    return {kind: 'sample', device: samples[1] ?? bySource(samples[2])};
  }
  const touches = kTouches.exec(topic);
  return touches === null ? null : {kind: 'touch', device: bySource(touches[1])};
}

import {useEffect, useRef, useState} from 'preact/hooks';
import {useApp} from '../store/app';
import {momentText} from '../model/span';
import {texts} from '../texts/texts';

const kSpeeds = [0.1, 0.25, 0.5, 1, 2, 5];
const kSeekMs = 100;

/** The time line of the open recording, below every view. */
export function Timeline() {
  const app = useApp();
  const replay = app.state.value?.replay ?? null;
  const [draggedS, setDragged] = useState<number | null>(null);
  const seekMs = useRef(0);
  // The handle stays where it was put until the console says that the replay is there.
  const timeNs = replay?.timeNs ?? 0;
  useEffect(() => setDragged(null), [timeNs]);
  if (replay === null) return null;
  const {recordings} = app;
  const words = texts.value.replay;
  const lengthS = (replay.endNs - replay.beginNs) / 1e9;
  const timeS = draggedS ?? (replay.timeNs - replay.beginNs) / 1e9;
  const isUsable = app.isLive.value && app.mayCommand.value;
  const seek = (toS: number, isFinal: boolean) => {
    setDragged(toS);
    const now = performance.now();
    if (!isFinal && now - seekMs.current < kSeekMs) return;
    seekMs.current = now;
    void recordings.seek(replay.beginNs + toS * 1e9);
  };
  const play = async () => {
    if (replay.timeNs >= replay.endNs) await recordings.seek(replay.beginNs);
    await recordings.play(replay.speed > 0 ? replay.speed : 1);
  };
  return (
    <footer class="timeline" aria-label={words.title}>
      <span class="timeline-mark">{words.mark}</span>
      <button
        type="button"
        disabled={!isUsable}
        class="play"
        data-testid="play"
        onClick={() => void (replay.isPlaying ? recordings.pause() : play())}
      >
        {replay.isPlaying ? words.pause : words.play}
      </button>
      <input
        type="range"
        min={0}
        max={lengthS}
        step={Math.max(0.001, lengthS / 2000)}
        value={timeS}
        disabled={!isUsable}
        aria-label={words.time}
        aria-valuetext={words.timeOf(momentText(timeS, 0), momentText(lengthS, 0))}
        onInput={(event) => seek(Number(event.currentTarget.value), false)}
        onChange={(event) => seek(Number(event.currentTarget.value), true)}
      />
      <output class="timeline-time" data-testid="replay-time">
        {momentText(timeS, 1)} / {momentText(lengthS, 1)}
      </output>
      <label class="speed">
        <span class="visually-hidden">{words.speed}</span>
        <select
          value={String(replay.speed)}
          disabled={!isUsable}
          onChange={(event) => void recordings.play(Number(event.currentTarget.value))}
        >
          {[...new Set([...kSpeeds, replay.speed])]
            .sort((a, b) => a - b)
            .map((one) => (
              <option key={one} value={String(one)}>
                {one}×
              </option>
            ))}
        </select>
      </label>
      <button type="button" disabled={!isUsable} onClick={() => void recordings.close()}>
        {texts.value.parts.close}
      </button>
    </footer>
  );
}

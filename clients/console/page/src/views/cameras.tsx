import {useEffect, useRef, useState} from 'preact/hooks';
import {useSignal} from '@preact/signals';
import {useApp} from '../store/app';
import {Camera} from '../store/camera';
import {eachFrame} from '../store/frames';
import type {Medium} from '../model/picture';
import {Card} from '../parts/parts';
import {Help} from '../parts/popup';
import {duration} from '../parts/text';
import {texts} from '../texts/texts';

/** A picture older than this is not live. */
const kStaleMs = 1000;

/** The laboratory's cameras, beside the device. */
export function Cameras() {
  const app = useApp();
  const media = app.state.value?.media ?? [];
  // The recording's pictures are in its file; here are the cameras of now.
  if (app.showsReplay.value) return null;
  return (
    <>
      {media.map((medium) => (
        <CameraCard key={medium.name} medium={medium} />
      ))}
    </>
  );
}

function CameraCard({medium}: {medium: Medium}) {
  const app = useApp();
  const canvas = useRef<HTMLCanvasElement>(null);
  const ageMs = useSignal<number | null>(null);
  const [camera, setCamera] = useState<Camera | null>(null);
  const {name} = medium;
  const isVisible = app.isVisible.value;
  useEffect(() => {
    if (canvas.current === null || !isVisible) return;
    const opened = new Camera(app.link, name, canvas.current);
    setCamera(opened);
    const end = eachFrame(() => {
      const age =
        opened.captureNs === null ? null : app.consoleMs() - Number(opened.captureNs) / 1e6;
      // Tens of milliseconds are enough to read.
      ageMs.value = age === null ? null : Math.max(0, Math.round(age / 10) * 10);
    });
    return () => {
      end();
      opened.close();
    };
  }, [name, isVisible]);
  const age = ageMs.value;
  const isFresh = app.isLive.value && age !== null && age <= kStaleMs;
  const words = texts.value.cameras;
  const problem = medium.problem !== '' ? medium.problem : (camera?.problem.value ?? '');
  return (
    <Card title={name} class={`camera ${isFresh ? '' : 'is-stale'}`}>
      <canvas
        ref={canvas}
        data-testid={`camera-${name}`}
        role="img"
        aria-label={words.name(name)}
      />
      <p class="camera-facts quiet small">
        {age === null ? words.none : words.captured(duration(age / 1000))}
        {medium.uncertaintyNs > 0 && ` ± ${Math.ceil(medium.uncertaintyNs / 1e6)} ms`}
        {medium.widthPx > 0 && ` · ${medium.widthPx} × ${medium.heightPx}`}
        {medium.rateHz > 0 && ` ${words.rate(Math.round(medium.rateHz))}`}
        {age !== null && !isFresh && ` · ${words.notLive}`} <Help of={name}>{words.help}</Help>
      </p>
      {problem !== '' && <p class="problem">{problem}</p>}
    </Card>
  );
}

import type {JSX} from 'preact';
import {useEffect, useRef} from 'preact/hooks';
import {lengthOf} from '../model/span';
import {eachFrame} from '../store/frames';
import {themeVersion} from '../store/theme';
import {beginFrame, xOf, type Size} from './canvas';
import {drawScene, type Scene} from './scene';
import {attachGestures, type TimeAxis} from './time_gestures';

type Attributes = Omit<JSX.HTMLAttributes<HTMLCanvasElement>, 'ref'>;

interface Props {
  /** null: nothing is there. */
  readonly scene: (size: Size) => Scene | null;
  readonly axis: () => TimeAxis | null;
  /** It is painted when it is rendered, and so often by itself; 0: only then. */
  readonly everyMs: () => number;
  /** They go to the canvas. */
  readonly attributes: Attributes;
}

/** A chart over time: a canvas with its gestures, and the line and the time of the crosshair. */
export function TimeChart(props: Props) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const cross = useRef<HTMLDivElement>(null);
  const latest = useRef(props);
  const isDue = useRef(true);
  latest.current = props;
  isDue.current = true;

  useEffect(() => {
    const element = canvas.current;
    if (element === null) return undefined;
    const detach = attachGestures(element, () => latest.current.axis());
    const observer = new ResizeObserver(() => (isDue.current = true));
    observer.observe(element);
    let lastMs = -Infinity;
    let theme = 0;
    const stop = eachFrame((nowMs) => {
      const isOld = nowMs - lastMs >= (latest.current.everyMs() || Infinity);
      if (!isOld && !isDue.current && theme === themeVersion.peek()) return;
      lastMs = nowMs;
      theme = themeVersion.peek();
      isDue.current = false;
      paint(element, cross.current, latest.current.scene);
    });
    return () => {
      stop();
      observer.disconnect();
      detach();
    };
  }, []);

  return (
    <div class="chart">
      <canvas ref={canvas} {...props.attributes} />
      <div ref={cross} class="plot-cross" hidden>
        <span />
      </div>
    </div>
  );
}

function paint(
  canvas: HTMLCanvasElement,
  cross: HTMLElement | null,
  sceneOf: Props['scene'],
): void {
  const context = beginFrame(canvas);
  if (context === null) return;
  const size = {width: canvas.clientWidth, height: canvas.clientHeight};
  const scene = sceneOf(size);
  const frame = scene && drawScene(context, size, scene);
  if (cross === null) return;
  const atS = scene?.crossS ?? NaN;
  cross.hidden = !scene || !(atS >= scene.span.fromS && atS <= scene.span.toS);
  if (cross.hidden || !scene || !frame) return;
  const x = xOf(frame, atS);
  cross.style.transform = `translateX(${x.toFixed(1)}px)`;
  cross.classList.toggle('is-right', x > frame.left + 0.8 * frame.width);
  const label = cross.firstElementChild;
  const text = scene.timeText(atS, lengthOf(scene.span) / 1000);
  if (label !== null && label.textContent !== text) label.textContent = text;
}

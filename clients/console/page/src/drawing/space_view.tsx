import {useEffect, useRef, useState} from 'preact/hooks';
import type {JSX} from 'preact';
import {length, type Vector3} from '../model/sample';
import {kStaleMs, type Device} from '../model/state';
import type {Motion} from '../store/motion';
import {eachFrame} from '../store/frames';
import {colour, themeVersion} from '../store/theme';
import {fixed} from '../parts/text';
import {texts} from '../texts/texts';
import type {Room, Space, ViewName} from './space';

const kAssumedM = 0.1;
const kAssumedNewton = 5;
const kTurnDegrees = 10;
const kViews: readonly ViewName[] = ['corner', 'front', 'side', 'top'];

export function roomOf(device: Device | null): Room {
  const low = device?.workspaceLowM ?? [];
  const high = device?.workspaceHighM ?? [];
  const isKnown =
    low.length === 3 && high.length === 3 && high.some((one, i) => one > (low[i] ?? 0));
  const at = (numbers: readonly number[]): Vector3 => [
    numbers[0] ?? 0,
    numbers[1] ?? 0,
    numbers[2] ?? 0,
  ];
  const assumed: Vector3 = [kAssumedM, kAssumedM, kAssumedM];
  return {
    low: isKnown ? at(low) : [-kAssumedM, -kAssumedM, -kAssumedM],
    high: isKnown ? at(high) : assumed,
    forceMaxNewton:
      device !== null && device.forceMaxNewton > 0 ? device.forceMaxNewton : kAssumedNewton,
    isAssumed: !isKnown,
  };
}

interface Props {
  name: string;
  device: Device | null;
  motion: Motion;
  nowMs: () => number;
  /** The connection is there; a recording's motion counts as it is. */
  isLive: boolean;
  isReplay: boolean;
}

/** The 3-D view of one device, with its numbers beside it. */
export function SpaceView(props: Props) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const label = useRef<HTMLDivElement>(null);
  const facts = useRef<HTMLDivElement>(null);
  const space = useRef<Space | null>(null);
  const latest = useRef(props);
  latest.current = props;
  const [problem, setProblem] = useState('');
  const [perNewton, setPerNewton] = useState(0);
  const room = roomOf(props.device);
  const roomKey = JSON.stringify(room);
  const version = themeVersion.value;
  const words = texts.value.space;

  useEffect(() => {
    const target = canvas.current;
    if (target === null) return undefined;
    let isEnded = false;
    const ends: (() => void)[] = [];
    void import('./space')
      .then(({Space: Loaded}) => {
        if (isEnded) return;
        const made = new Loaded(target, JSON.parse(roomKey) as Room, colour);
        space.current = made;
        setPerNewton(made.millimetresPerNewton);
        const observer = new ResizeObserver(() =>
          made.resize(target.clientWidth, target.clientHeight),
        );
        observer.observe(target);
        made.resize(target.clientWidth, target.clientHeight);
        const stop = eachFrame(() => paint(made, latest.current, label.current, facts.current));
        ends.push(
          stop,
          () => observer.disconnect(),
          () => made.dispose(),
        );
      })
      .catch((error: Error) => setProblem(error.message));
    return () => {
      isEnded = true;
      space.current = null;
      ends.forEach((end) => end());
    };
    // A canvas keeps its WebGL context, so a new room or theme takes a new canvas (`key` below).
  }, [roomKey, version]);

  const onKeyDown = (event: JSX.TargetedKeyboardEvent<HTMLCanvasElement>) => {
    const turns: Record<string, () => void> = {
      ArrowLeft: () => space.current?.turn(-kTurnDegrees, 0),
      ArrowRight: () => space.current?.turn(kTurnDegrees, 0),
      ArrowUp: () => space.current?.turn(0, kTurnDegrees),
      ArrowDown: () => space.current?.turn(0, -kTurnDegrees),
      '+': () => space.current?.zoom(0.85),
      '-': () => space.current?.zoom(1 / 0.85),
    };
    const turn = turns[event.key];
    if (turn === undefined || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    turn();
  };

  return (
    <div class={`space ${props.isReplay ? 'is-replay' : ''}`}>
      <canvas
        key={`${roomKey} ${version}`}
        ref={canvas}
        class="space-canvas"
        tabIndex={0}
        role="img"
        aria-label={words.view(props.name)}
        onKeyDown={onKeyDown}
      />
      <div ref={label} class="space-label" hidden />
      <div class="space-words">
        <div ref={facts} class="space-facts" data-testid="space-facts" />
        <div class="space-legend" aria-hidden="true">
          <span class="key key-tool">{words.tool}</span>
          <span class="key key-proxy">{words.proxy}</span>
          <span class="key key-wall">{words.touched}</span>
          {perNewton > 0 && (
            <span class="key key-force">{words.forceScale(fixed(perNewton, 1))}</span>
          )}
        </div>
      </div>
      {problem !== '' && (
        <p class="space-problem" role="status">
          {words.problem(problem)}
        </p>
      )}
      <div class="space-views" role="group" aria-label={words.viewpoint}>
        {kViews.map((view) => (
          <button type="button" key={view} onClick={() => space.current?.look(view)}>
            {words[view]}
          </button>
        ))}
      </div>
    </div>
  );
}

function paint(
  space: Space,
  props: Props,
  label: HTMLElement | null,
  facts: HTMLElement | null,
): void {
  const now = props.nowMs();
  const track = props.motion.track(props.name);
  const isFresh =
    props.isReplay || (props.isLive && track !== null && now - track.sampleMs <= kStaleMs);
  const hasTouch =
    track !== null && (props.isReplay || (isFresh && now - track.touchMs <= kStaleMs));
  const at = space.paint3d({
    track,
    endS: props.isReplay ? (track?.series.lastS ?? null) : (track?.endS(now) ?? null),
    touch: hasTouch ? track.touch : null,
    isFresh,
  });
  const sample = track?.sample ?? null;
  if (facts !== null) facts.textContent = factsOf(sample?.positionM ?? null, isFresh, hasTouch);
  if (label === null) return;
  label.hidden = at === null || sample === null;
  if (at === null || sample === null) return;
  label.textContent = `${fixed(length(sample.forceNewton), 2)} N`;
  label.style.transform = `translate(${at.x.toFixed(1)}px, ${at.y.toFixed(1)}px)`;
}

function factsOf(positionM: Vector3 | null, isFresh: boolean, hasTouch: boolean): string {
  if (positionM === null) return texts.value.space.noSamples;
  if (!isFresh) return texts.value.space.lastKnown;
  const [x, y, z] = positionM.map((one) => fixed(1000 * one, 1).padStart(6, '\u2007'));
  return `x${x}   y${y}   z${z}   mm${hasTouch ? '' : `   ${texts.value.space.noForceNode}`}`;
}

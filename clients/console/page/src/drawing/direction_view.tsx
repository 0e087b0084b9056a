import {useEffect, useRef} from 'preact/hooks';
import {eachFrame} from '../store/frames';
import {fixed} from '../parts/text';
import {angle} from '../store/settings';
import {texts} from '../texts/texts';

const kRangeDeg = 30;
const kRingsDeg = {
  degrees: [10, 20, 30],
  radians: [0.1, 0.3, 0.5].map((one) => (one * 180) / Math.PI),
};
/** How much of the past the trail shows. */
export const kTrailS = 1;
const kTrailMax = 60;

/** In degrees to the right and upwards. */
export type Direction = readonly [number, number];

/**
 * Where a gaze or pointer without a place points: up and to the right, with its last second, the
 * newest last.
 */
export function DirectionView({source}: {source: () => readonly Direction[]}) {
  const dot = useRef<SVGCircleElement>(null);
  const trail = useRef<SVGPolylineElement>(null);
  const latest = useRef(source);
  latest.current = source;
  const isRadians = angle.value === 'radians';
  useEffect(() => eachFrame(() => paint(latest.current(), dot.current, trail.current)), []);
  return (
    <figure class="direction" data-testid="direction">
      <svg
        viewBox={`${-kRangeDeg - 3} ${-kRangeDeg - 3} ${2 * kRangeDeg + 6} ${2 * kRangeDeg + 6}`}
        role="img"
        aria-label={texts.value.space.direction}
      >
        {kRingsDeg[angle.value].map((ring) => (
          <g key={ring}>
            <circle class="ring" r={ring} />
            <text x={0.5} y={-ring - 0.6}>
              {isRadians ? `${fixed((ring * Math.PI) / 180, 1)} rad` : `${ring}°`}
            </text>
          </g>
        ))}
        <path class="ring" d={`M${-kRangeDeg} 0H${kRangeDeg}M0 ${-kRangeDeg}V${kRangeDeg}`} />
        <polyline ref={trail} class="trail" />
        <circle ref={dot} class="dot" r={1.4} />
      </svg>
    </figure>
  );
}

function clamped(degrees: number): number {
  return Math.min(kRangeDeg, Math.max(-kRangeDeg, degrees));
}

function paint(
  shown: readonly Direction[],
  dot: SVGCircleElement | null,
  trail: SVGPolylineElement | null,
): void {
  if (dot === null || trail === null) return;
  const points = shown.slice(-kTrailMax).map(([right, up]) => [clamped(right), -clamped(up)]);
  const last = points.at(-1);
  dot.style.visibility = trail.style.visibility = last === undefined ? 'hidden' : 'visible';
  if (last === undefined) return;
  trail.setAttribute('points', points.join(' '));
  dot.setAttribute('cx', String(last[0]));
  dot.setAttribute('cy', String(last[1]));
}

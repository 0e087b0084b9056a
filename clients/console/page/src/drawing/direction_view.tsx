import {useEffect, useRef} from 'preact/hooks';
import {eachFrame} from '../store/frames';
import {kColumn} from '../store/motion';
import {fixed} from '../parts/text';
import {angle} from '../store/settings';
import {texts} from '../texts/texts';
import type {ChartSource} from './strip_chart';

const kRangeDeg = 30;
const kRingsDeg = {
  degrees: [10, 20, 30],
  radians: [0.1, 0.3, 0.5].map((one) => (one * 180) / Math.PI),
};
const kTrailS = 1;
const kTrailMax = 60;

/** Where a gaze or pointer without a place points: up and to the right, with its last second. */
export function DirectionView({source}: {source: () => ChartSource | null}) {
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
  source: ChartSource | null,
  dot: SVGCircleElement | null,
  trail: SVGPolylineElement | null,
): void {
  if (dot === null || trail === null) return;
  const isShown = source !== null && source.isFresh && source.series.size > 0;
  dot.style.visibility = trail.style.visibility = isShown ? 'visible' : 'hidden';
  if (!isShown) return;
  const {series} = source;
  const at = (row: number) => [
    clamped(series.valueAt(row, kColumn.direction)),
    -clamped(series.valueAt(row, kColumn.direction + 1)),
  ];
  const last = series.size - 1;
  const first = Math.max(series.rowAt(series.timeAt(last) - kTrailS), last - kTrailMax);
  const points: string[] = [];
  for (let row = first; row <= last; ++row) points.push(at(row).join());
  trail.setAttribute('points', points.join(' '));
  const [x, y] = at(last);
  dot.setAttribute('cx', String(x));
  dot.setAttribute('cy', String(y));
}

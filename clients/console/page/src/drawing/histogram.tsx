import {shareWithin, type Latency, type Target} from '../model/latency';
import {Empty} from '../parts/parts';
import {fixed, micros, thousands} from '../parts/text';

const kWidth = 640;
const kHeight = 200;
const kBottom = 26;
const kTop = 22;
const kLowUs = 5;
const kHighUs = 20000;
const kTicks = [10, 100, 1000, 10000];

function xOf(us: number): number {
  const share = Math.log(us / kLowUs) / Math.log(kHighUs / kLowUs);
  return kWidth * Math.min(1, Math.max(0, share));
}

/** Counts span decades: their height is logarithmic, so that the rare long calls show, too. */
function heightOf(count: number, most: number): number {
  if (count <= 0) return 0;
  return ((kHeight - kBottom - kTop) * Math.log10(1 + count)) / Math.log10(1 + most);
}

/** How long calls took, beside the paper's figures, on logarithmic scales. */
export function Histogram({latency, name}: {latency: Latency | null; name: string}) {
  const target = latency?.targets.find((one) => one.name === name) ?? null;
  if (latency === null || target === null || target.count === 0) {
    return <Empty>No calls measured yet.</Empty>;
  }
  const most = Math.max(...target.bins.map((bin) => bin.count), 1);
  const base = kHeight - kBottom;
  return (
    <div class="histogram">
      <svg
        viewBox={`0 0 ${kWidth} ${kHeight}`}
        role="img"
        preserveAspectRatio="none"
        aria-label={words(target, latency)}
      >
        {kTicks.map((us) => (
          <line key={us} class="grid" x1={xOf(us)} x2={xOf(us)} y1={kTop} y2={base} />
        ))}
        {target.bins
          .filter((bin) => bin.count > 0)
          .map((bin) => {
            const height = heightOf(bin.count, most);
            const x = xOf(Math.max(kLowUs, bin.fromUs));
            const width = Math.max(1, xOf(bin.toUs) - x - 1);
            const tone =
              bin.toUs <= latency.paperBestUs
                ? 'fast'
                : bin.toUs <= latency.paperCycleUs
                  ? 'fair'
                  : 'slow';
            return (
              <rect
                key={bin.fromUs}
                class={tone}
                x={x}
                width={width}
                y={base - height}
                height={height}
              />
            );
          })}
        <line class="axis" x1={0} x2={kWidth} y1={base} y2={base} />
        {[latency.paperBestUs, latency.paperCycleUs].map((us) => (
          <line key={us} class="paper" x1={xOf(us)} x2={xOf(us)} y1={kTop - 4} y2={base} />
        ))}
      </svg>
      <div class="histogram-labels" aria-hidden="true">
        {kTicks.map((us) => (
          <span key={us} class="tick" style={{left: `${(100 * xOf(us)) / kWidth}%`}}>
            {us < 1000 ? `${us} µs` : `${us / 1000} ms`}
          </span>
        ))}
        {[latency.paperBestUs, latency.paperCycleUs].map((us) => (
          <span key={us} class="mark" style={{left: `${(100 * xOf(us)) / kWidth}%`}}>
            paper {us < 1000 ? `${us} µs` : `${us / 1000} ms`}
          </span>
        ))}
      </div>
      <Table target={target} latency={latency} />
    </div>
  );
}

function percent(share: number | null): string {
  return share === null ? '–' : `${fixed(100 * share, 1)} %`;
}

function words(target: Target, latency: Latency): string {
  return (
    `Latency of ${thousands(target.count)} reads: half within ${micros(target.p50Us)}, ` +
    `${percent(shareWithin(target.bins, latency.paperBestUs))} within the paper's ` +
    `${latency.paperBestUs} microseconds`
  );
}

function Table({target, latency}: {target: Target; latency: Latency}) {
  const rows: [string, string][] = [
    ['p50', micros(target.p50Us)],
    ['p90', micros(target.p90Us)],
    ['p99', micros(target.p99Us)],
    ['p99.9', micros(target.p999Us)],
    ['max', micros(target.maxUs)],
  ];
  const within = (us: number) => percent(shareWithin(target.bins, us));
  return (
    <>
      <dl class="figures">
        {rows.map(([name, value]) => (
          <div key={name}>
            <dt>{name}</dt>
            <dd>{value}</dd>
          </div>
        ))}
      </dl>
      <p class="quiet small">
        {within(latency.paperBestUs)} of {thousands(target.count)} reads by this console within 58
        µs (paper: 91 %), {within(latency.paperCycleUs)} within 1 ms (paper: 99.8 %)
        {target.failedCount > 0 ? `; ${thousands(target.failedCount)} failed` : ''}.
      </p>
    </>
  );
}

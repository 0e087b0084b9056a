import {shareWithin, type Latency, type Target} from '../model/latency';
import {Empty} from '../parts/parts';
import {fixed, micros, percent, thousands} from '../parts/text';
import {texts} from '../texts/texts';

const kWidth = 640;
const kHeight = 200;
const kBottom = 26;
const kTop = 22;
const kLowUs = 5;
const kHighUs = 20000;
/** A cycle of a force loop of 1 kHz. */
const kCycleUs = 1000;
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

/** How long calls took, on logarithmic scales. */
export function Histogram({latency, name}: {latency: Latency | null; name: string}) {
  const target = latency?.targets.find((one) => one.name === name) ?? null;
  if (latency === null || target === null || target.count === 0) {
    return <Empty>{texts.value.live.notMeasured}</Empty>;
  }
  const most = Math.max(...target.bins.map((bin) => bin.count), 1);
  const base = kHeight - kBottom;
  return (
    <div class="histogram">
      <svg
        viewBox={`0 0 ${kWidth} ${kHeight}`}
        role="img"
        preserveAspectRatio="none"
        aria-label={words(target)}
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
            return (
              <rect
                key={bin.fromUs}
                class={bin.toUs <= kCycleUs ? 'fast' : 'slow'}
                x={x}
                width={width}
                y={base - height}
                height={height}
              />
            );
          })}
        <line class="axis" x1={0} x2={kWidth} y1={base} y2={base} />
      </svg>
      <div class="histogram-labels" aria-hidden="true">
        {kTicks.map((us) => (
          <span key={us} class="tick" style={{left: `${(100 * xOf(us)) / kWidth}%`}}>
            {us < 1000 ? `${us} µs` : `${us / 1000} ms`}
          </span>
        ))}
      </div>
      <Table target={target} />
    </div>
  );
}

function words(target: Target): string {
  const within = percent(shareWithin(target.bins, kCycleUs), 1);
  return texts.value.live.histogram(thousands(target.count), micros(target.p50Us), within);
}

function Table({target}: {target: Target}) {
  const {live} = texts.value;
  const rows: [string, string, string][] = [
    ['p50', micros(target.p50Us), live.half],
    ['p90', micros(target.p90Us), live.share('90 %')],
    ['p99', micros(target.p99Us), live.share('99 %')],
    ['p99.9', micros(target.p999Us), live.share(`${fixed(99.9, 1)} %`)],
    [live.longest, micros(target.maxUs), live.longestHelp],
  ];
  return (
    <>
      <dl class="figures">
        {rows.map(([name, value, help]) => (
          <div key={name} title={help}>
            <dt>{name}</dt>
            <dd>{value}</dd>
          </div>
        ))}
      </dl>
      <p class="quiet small">
        {live.within(percent(shareWithin(target.bins, kCycleUs), 1), thousands(target.count))}
        {target.failedCount > 0 ? ` ${live.failed(thousands(target.failedCount))}` : ''}
      </p>
    </>
  );
}

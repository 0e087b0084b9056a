import {condition, freshness, type Condition, type Device, type Standing} from '../model/state';
import {Badge, type Tone} from '../parts/parts';
import {duration} from '../parts/text';

const kLifecycleTones: Readonly<Record<string, Tone>> = {
  active: 'good',
  inactive: 'plain',
  fault: 'bad',
  unconfigured: 'warn',
  finalized: 'warn',
};

/** How old what is known of a device is, in words. */
export function Age({device, isLive}: {device: Device; isLive: boolean}) {
  if (!isLive) return <Badge>not live</Badge>;
  const state = freshness(device);
  if (state === 'lost') {
    const since = device.lostForS === null ? '' : ` for ${duration(device.lostForS)}`;
    return <Badge tone="bad">lost{since}</Badge>;
  }
  if (device.ageMs === null) return <Badge tone="warn">no samples</Badge>;
  const age = duration(device.ageMs / 1000);
  return state === 'stale' ? (
    <Badge tone="warn">stale for {age}</Badge>
  ) : (
    <span class="age">{age} old</span>
  );
}

export function Lifecycle({device}: {device: Device}) {
  if (device.isStopped) return <Badge tone="bad">emergency stop</Badge>;
  const worst = condition(device);
  const tones = {good: null, stale: 'warn', fault: 'bad', stopped: 'bad', lost: 'plain'} as const;
  const tone = tones[worst] ?? kLifecycleTones[device.lifecycle] ?? 'plain';
  return <Badge tone={tone}>{device.lifecycle}</Badge>;
}

const kConditionWords: Readonly<Record<Condition, string>> = {
  lost: 'lost',
  stopped: 'in emergency stop',
  fault: 'in fault',
  stale: 'stale',
  good: 'live',
};

export function conditionText(device: Device): string {
  return kConditionWords[condition(device)];
}

/** "2 lost", of the worst condition that there is; of all good ones "5 of 5 live". */
export function worstText({worst, counts}: Standing): string {
  const count = Object.values(counts).reduce((sum, one) => sum + one, 0);
  if (count === 0) return 'none';
  if (worst === 'good') return `${count} of ${count} live`;
  return `${counts[worst]} ${kConditionWords[worst]}`;
}

/** The less bad ones beside it: "12 in fault, 36 of 49 live". */
export function otherText({worst, counts}: Standing): string {
  const count = Object.values(counts).reduce((sum, one) => sum + one, 0);
  const others = (['stopped', 'fault', 'stale'] as const)
    .filter((one) => one !== worst && counts[one] > 0)
    .map((one) => `${counts[one]} ${kConditionWords[one]}`);
  return [...others, `${counts.good} of ${count} live`].join(', ');
}

/** Which client holds the lease, since when, and how long. */
export function LeaseText({device}: {device: Device}) {
  const {state, sinceS, endsInS} = device.lease;
  const since = sinceS === null ? '' : ` for ${duration(sinceS)}`;
  switch (state) {
    case 'held by this console':
      return (
        <span>
          this console{since},{' '}
          {endsInS === null ? 'until released' : `its browser is gone: ${duration(endsInS)} left`}
        </span>
      );
    case 'held':
      return <span>another client{since}</span>;
    case 'free':
      return <span class="quiet">free</span>;
    default:
      return <span class="quiet">{state}</span>;
  }
}

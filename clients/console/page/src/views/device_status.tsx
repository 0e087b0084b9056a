import {freshness, type Device} from '../model/state';
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
  if (state === 'lost') return <Badge tone="bad">lost</Badge>;
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
  return <Badge tone={kLifecycleTones[device.lifecycle] ?? 'plain'}>{device.lifecycle}</Badge>;
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

import {condition, freshness, type Device, type Standing} from '../model/state';
import {useApp} from '../store/app';
import {Badge, type Tone} from '../parts/parts';
import {duration, timeOfDay} from '../parts/text';
import {texts} from '../texts/texts';

const kLifecycleTones: Readonly<Record<string, Tone>> = {
  active: 'good',
  inactive: 'plain',
  fault: 'bad',
  unconfigured: 'warn',
  finalized: 'warn',
};

/** How old what is known of a device is, in words. */
export function Age({device, isLive}: {device: Device; isLive: boolean}) {
  const words = texts.value.condition;
  if (!isLive) return <Badge>{words.notLive}</Badge>;
  const state = freshness(device);
  if (state === 'lost') {
    const {lostForS} = device;
    return (
      <Badge tone="bad">{lostForS === null ? words.lost : words.lostFor(duration(lostForS))}</Badge>
    );
  }
  if (device.ageMs === null) return <Badge tone="warn">{words.noSamples}</Badge>;
  const age = duration(device.ageMs / 1000);
  return state === 'stale' ? (
    <Badge tone="warn">{words.staleFor(age)}</Badge>
  ) : (
    <span class="age">{words.old(age)}</span>
  );
}

export function Lifecycle({device}: {device: Device}) {
  if (device.isStopped) return <Badge tone="bad">{texts.value.condition.emergencyStop}</Badge>;
  const worst = condition(device);
  const tones = {good: null, stale: 'warn', fault: 'bad', stopped: 'bad', lost: 'plain'} as const;
  const tone = tones[worst] ?? kLifecycleTones[device.lifecycle] ?? 'plain';
  return <Badge tone={tone}>{device.lifecycle}</Badge>;
}

export function conditionText(device: Device): string {
  return texts.value.condition[condition(device)];
}

/** "2 lost", of the worst condition that there is; of all good ones "5 of 5 live". */
export function worstText({worst, counts}: Standing): string {
  const words = texts.value.condition;
  const count = Object.values(counts).reduce((sum, one) => sum + one, 0);
  if (count === 0) return words.none;
  return worst === 'good' ? words.ofLive(count, count) : `${counts[worst]} ${words[worst]}`;
}

/** The less bad ones beside it: "12 in fault, 36 of 49 live". */
export function otherText({worst, counts}: Standing): string {
  const words = texts.value.condition;
  const count = Object.values(counts).reduce((sum, one) => sum + one, 0);
  const others = (['stopped', 'fault', 'stale'] as const)
    .filter((one) => one !== worst && counts[one] > 0)
    .map((one) => `${counts[one]} ${words[one]}`);
  return [...others, words.ofLive(counts.good, count)].join(', ');
}

/** The holder of the lease in words: "Anna", "rtpm-servo on lab2"; empty: nobody. */
export function holderText(device: Device): string {
  const words = texts.value.lease;
  const {state, holder, operator} = device.lease;
  if (state === 'held by this console') {
    return operator === null || operator.name === '' ? words.thisConsole : operator.name;
  }
  if (state === 'held') return holder === '' ? words.another : holder;
  return '';
}

/** Which client holds the lease, since when, and how long. */
export function LeaseText({device}: {device: Device}) {
  const app = useApp();
  const words = texts.value.lease;
  const {state, sinceS, endsInS, operator} = device.lease;
  if (state === 'free') return <span class="quiet">{words.free}</span>;
  if (state !== 'held' && state !== 'held by this console') {
    return <span class="quiet">{state === 'unknown' ? words.unknown : state}</span>;
  }
  const parts = [holderText(device)];
  if (operator !== null && operator.room !== '' && state !== 'held') {
    const isHere = operator.room === app.operator.room.value;
    parts.push(isHere ? words.thisRoom : operator.room);
  }
  if (operator !== null && operator.sinceNs > 0 && state !== 'held') {
    parts.push(words.since(timeOfDay(operator.sinceNs / 1e6).replace(/:\d\d$/, '')));
  } else if (sinceS !== null) {
    parts.push(words.for(duration(sinceS)));
  }
  if (state === 'held by this console') {
    if (operator?.isGone === true && operator.isKept) parts.push(words.goneKept);
    else parts.push(endsInS === null ? words.untilReleased : words.gone(duration(endsInS)));
  }
  return <span>{parts.join(', ')}</span>;
}

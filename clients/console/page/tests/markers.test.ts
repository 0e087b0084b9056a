import {beforeEach, describe, expect, it, vi} from 'vitest';
import {signal} from '@preact/signals';
import {CallError, type Channel, type Message} from '../src/protocol/client';
import type {Json} from '../src/protocol/json';
import type {Link} from '../src/store/link';
import {kMarkerMax, kResendMs, Markers, trialsOf, type Marker} from '../src/store/markers';

const kept = new Map<string, string>();
vi.stubGlobal('localStorage', {
  getItem: (key: string) => kept.get(key) ?? null,
  setItem: (key: string, value: string) => kept.set(key, value),
});

type Handler = (message: Message) => void;

/** A link that answers calls as a test says. */
class FakeLink {
  readonly channels = signal<ReadonlyMap<string, Channel>>(new Map());
  readonly services = signal<ReadonlySet<string>>(new Set(['console/mark']));
  readonly handlers = new Map<string, Handler>();
  readonly calls: {service: string; request: {[key: string]: Json}}[] = [];
  isLive = true;
  answer: () => Promise<Json> = () => Promise.resolve({});

  subscribe(topic: string, handle: Handler): () => void {
    this.handlers.set(topic, handle);
    return () => this.handlers.delete(topic);
  }

  call(service: string, request: Json): Promise<Json> {
    this.calls.push({service, request: request as {[key: string]: Json}});
    return this.answer();
  }

  say(value: Json): void {
    this.handlers.get('console/marks')?.({value, timeNs: 0n} as unknown as Message);
  }
}

let nowMs = 0;
let link: FakeLink;
let markers: Markers;

beforeEach(() => {
  vi.useFakeTimers();
  nowMs = 0;
  kept.clear();
  link = new FakeLink();
  markers = new Markers(
    link as unknown as Link,
    () => 5000 + nowMs,
    () => nowMs,
  );
});

async function pass(ms: number): Promise<void> {
  nowMs += ms;
  await vi.advanceTimersByTimeAsync(ms);
}

function marker(fields: Partial<Marker>): Marker {
  return {
    key: 0,
    timeNs: 0,
    label: '',
    phase: 'mark',
    number: 0,
    source: 0,
    condition: '',
    response: '',
    durationNs: null,
    ...fields,
  };
}

describe('markers that come', () => {
  it('stand in the order of their times, with words of their own', async () => {
    link.say({
      marks: [
        {time_ns: 2e9, label: 'yawns'},
        {time_ns: 1e9, phase: 'begin', number: 3, condition: 'soft'},
      ],
    });
    await pass(200);
    expect(markers.live.rows.value.map((one) => one.label)).toEqual(['trial 3 begin', 'yawns']);
    expect(markers.nextNumber.value).toBe(4);
    expect(markers.open.value?.number).toBe(3);
  });

  it('are kept up to a limit, and the others counted', async () => {
    const many = Array.from({length: 3 * kMarkerMax}, (_, i) => ({time_ns: i, label: `m${i}`}));
    link.say({marks: many, omitted: 5});
    await pass(200);
    link.say({marks: [{time_ns: 1e9, label: 'last'}]});
    await pass(200);
    expect(markers.live.rows.value).toHaveLength(kMarkerMax);
    expect(markers.live.rows.value.at(-1)?.label).toBe('last');
    expect(markers.live.omittedCount.value).toBe(2 * kMarkerMax + 5 + 1);
  });

  it('begin anew with a new connection, which has them all', async () => {
    link.say({marks: [{time_ns: 1, label: 'a'}]});
    await pass(200);
    link.say({is_first: true, marks: [{time_ns: 1, label: 'a'}]});
    await pass(200);
    expect(markers.live.rows.value).toHaveLength(1);
  });
});

describe('a mark of this page', () => {
  it('has the time of the press, and waits until it is confirmed', async () => {
    let confirm = (_: Json) => {};
    link.answer = () => new Promise((resolve) => (confirm = resolve));
    const marking = markers.mark({label: 'yawns'});
    expect(markers.sent.value[0]).toMatchObject({label: 'yawns', state: 'waits'});
    expect(link.calls[0]?.request).toMatchObject({label: 'yawns', time_ns: 5e9});
    confirm({});
    expect(await marking).toBe(true);
    expect(markers.sent.value).toEqual([]);
  });

  it('stays on the page with the reason where it is refused', async () => {
    link.answer = () => Promise.reject(new CallError('no hub answers'));
    expect(await markers.mark({label: 'yawns'})).toBe(false);
    expect(markers.sent.value[0]).toMatchObject({state: 'failed', why: 'no hub answers'});
    markers.dismiss(markers.sent.value[0]?.key ?? 0);
    expect(markers.sent.value).toEqual([]);
  });

  it('is sent again with its time and id when the connection returns', async () => {
    link.isLive = false;
    link.services.value = new Set();
    link.answer = () => Promise.reject(new CallError('the connection is lost', true));
    const marking = markers.mark({label: 'yawns'});
    await pass(3000);
    expect(markers.sent.value[0]?.state).toBe('waits');
    link.answer = () => Promise.resolve({});
    link.services.value = new Set(['console/mark']);
    await pass(300);
    expect(await marking).toBe(true);
    const [first, second] = link.calls.map((one) => one.request);
    expect(second).toEqual(first);
  });

  it('fails if the connection stays lost', async () => {
    link.isLive = false;
    link.services.value = new Set();
    link.answer = () => Promise.reject(new CallError('the connection is lost', true));
    const marking = markers.mark({label: 'yawns'});
    await pass(kResendMs + 500);
    expect(await marking).toBe(false);
    expect(markers.sent.value[0]?.state).toBe('failed');
  });
});

describe('trials', () => {
  it('are intervals with condition and response', () => {
    const trials = trialsOf([
      marker({phase: 'begin', number: 1, timeNs: 10, condition: 'soft'}),
      marker({timeNs: 12}),
      marker({phase: 'end', number: 1, timeNs: 30, response: 'left'}),
      marker({phase: 'begin', number: 2, timeNs: 40}),
    ]);
    expect(trials).toMatchObject([
      {number: 1, beginNs: 10, endNs: 30, condition: 'soft', response: 'left'},
      {number: 2, beginNs: 40, endNs: null},
    ]);
  });

  it('begin where an end says, if their begin is not there', () => {
    const trials = trialsOf([marker({phase: 'end', number: 9, timeNs: 30, durationNs: 5})]);
    expect(trials).toMatchObject([{number: 9, beginNs: 25, endNs: 30}]);
    expect(trialsOf([marker({phase: 'end', number: 9, timeNs: 30})])).toEqual([]);
  });
});

it("keeps the buttons, and makes none of another page's nonsense", () => {
  markers.setButtons([{label: 'pain', key: 'p'}]);
  const again = new Markers(
    link as unknown as Link,
    () => 0,
    () => 0,
  );
  expect(again.buttons.value).toEqual([{label: 'pain', key: 'p'}]);
  kept.set('rtpm.markers', '{"not": "a list"}');
  const other = new Markers(
    link as unknown as Link,
    () => 0,
    () => 0,
  );
  expect(other.buttons.value.length).toBeGreaterThan(0);
});

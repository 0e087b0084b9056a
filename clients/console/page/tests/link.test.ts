import {beforeEach, describe, expect, it, vi} from 'vitest';
import type {Message, Socket} from '../src/protocol/client';
import {readFrame} from '../src/protocol/frames';
import {Link} from '../src/store/link';
import {isStopKey, Stop} from '../src/store/stop';
import {recorded, schemaText} from './recorded';

class FakeSocket implements Socket {
  binaryType = '';
  onopen: Socket['onopen'] = null;
  onclose: Socket['onclose'] = null;
  onerror: Socket['onerror'] = null;
  onmessage: Socket['onmessage'] = null;
  readonly sent: (string | Uint8Array)[] = [];
  isClosed = false;

  send(data: string | Uint8Array): void {
    this.sent.push(data);
  }

  close(): void {
    this.isClosed = true;
  }

  open(): void {
    this.onopen?.({} as Event);
  }

  say(data: unknown): void {
    const text = data instanceof ArrayBuffer ? data : JSON.stringify(data);
    this.onmessage?.({data: text} as MessageEvent);
  }

  ops(): {op: string; subscriptions?: {id: number; channelId: number}[]}[] {
    return this.sent
      .filter((one): one is string => typeof one === 'string')
      .map((one) => JSON.parse(one) as {op: string});
  }
}

const kService = {id: 7, name: 'console/estop', type: ''};
const kSampled = {
  id: 3,
  topic: 'lab/arm0/sample',
  encoding: 'flatbuffer',
  schemaName: 'rtpm.device.Sampled',
  schema: schemaText('rtpm.device.Sampled'),
};

let nowMs = 1000;
let sockets: FakeSocket[] = [];
let link: Link;

function newest(): FakeSocket {
  const socket = sockets.at(-1);
  if (socket === undefined) throw new Error('no connection was made');
  return socket;
}

function pass(ms: number): void {
  for (let end = nowMs + ms; nowMs < end;) {
    nowMs = Math.min(end, nowMs + 100);
    link.check();
  }
}

function connect(): FakeSocket {
  const socket = newest();
  socket.open();
  socket.say({op: 'serverInfo', name: 'rtpm-console', metadata: {'rtpm.access': 'command'}});
  socket.say({op: 'advertise', channels: [kSampled]});
  socket.say({op: 'advertiseServices', services: [kService]});
  return socket;
}

function messageFrame(subscription: number, payload: Uint8Array): ArrayBuffer {
  const bytes = new Uint8Array(13 + payload.length);
  const view = new DataView(bytes.buffer);
  view.setUint8(0, 1);
  view.setUint32(1, subscription, true);
  view.setBigUint64(5, 1_795_000_000_000_000_123n, true);
  bytes.set(payload, 13);
  return bytes.buffer;
}

function reply(callId: number, text: string): ArrayBuffer {
  const payload = new TextEncoder().encode(`json${text}`);
  const bytes = new Uint8Array(13 + payload.length);
  const view = new DataView(bytes.buffer);
  view.setUint8(0, 3);
  view.setUint32(1, kService.id, true);
  view.setUint32(5, callId, true);
  view.setUint32(9, 4, true);
  bytes.set(payload, 13);
  return bytes.buffer;
}

function lastCall(socket: FakeSocket): {id: number; request: string} {
  const frame = socket.sent.filter((one): one is Uint8Array => typeof one !== 'string').at(-1);
  if (frame === undefined) throw new Error('nothing was called');
  const view = new DataView(frame.buffer);
  return {
    id: view.getUint32(5, true),
    request: new TextDecoder().decode(frame.slice(13 + view.getUint32(9, true))),
  };
}

beforeEach(() => {
  nowMs = 1000;
  sockets = [];
  link = new Link({
    open: () => {
      sockets.push(new FakeSocket());
      return newest();
    },
    nowMs: () => nowMs,
  });
  vi.useFakeTimers();
  link.start();
  vi.clearAllTimers(); // `pass` drives the clock.
});

describe('Link', () => {
  it('has one connection at a time, also when it is looked after before it starts', () => {
    const fresh: FakeSocket[] = [];
    const other = new Link({
      open: () => {
        fresh.push(new FakeSocket());
        return fresh.at(-1) as FakeSocket;
      },
      nowMs: () => nowMs,
    });
    other.check();
    other.start();
    other.start();
    other.check();
    expect(fresh).toHaveLength(1);
    other.stop();
  });

  it('is live while something comes, and silent within a tenth of a second after one', () => {
    const socket = connect();
    expect(link.state.value.phase).toBe('live');
    pass(1000);
    expect(link.state.value.phase).toBe('live');
    pass(100);
    expect(link.state.value.phase).toBe('silent');
    socket.say({op: 'status', level: 0, message: ''});
    expect(link.state.value.phase).toBe('live');
  });

  it('gives a silent connection up, and tries again ever more slowly', () => {
    connect();
    pass(5100);
    expect(newest().isClosed).toBe(true);
    expect(link.state.value.phase).toBe('lost');
    expect(link.services.value.size).toBe(0);
    const pauses: number[] = [];
    for (let i = 0; i < 6; ++i) {
      const count = sockets.length;
      const lostMs = nowMs;
      while (sockets.length === count) pass(100);
      pauses.push(nowMs - lostMs);
      newest().onclose?.({} as CloseEvent);
    }
    expect(pauses).toEqual([500, 1000, 2000, 4000, 5000, 5000]);
  });

  it('gives up a connection that never opens', () => {
    pass(5100);
    expect(newest().isClosed).toBe(true);
  });

  it('subscribes anew after each reconnection, and hands decoded messages on', () => {
    const seen: Message[] = [];
    link.subscribe('lab/arm0/sample', (message) => seen.push(message));
    connect().onclose?.({} as CloseEvent);
    pass(600);
    const socket = connect();
    const subscription = socket.ops().find((one) => one.op === 'subscribe')?.subscriptions?.[0];
    expect(subscription?.channelId).toBe(3);
    const payload = recorded.find((one) => one.schemaName === 'rtpm.device.Sampled')!.payload;
    socket.say(messageFrame(subscription!.id, payload));
    expect(seen).toHaveLength(1);
    expect(seen[0]?.timeNs).toBe(1_795_000_000_000_000_123n);
    expect(seen[0]?.value).toHaveProperty('sample.force_newton.z');
  });

  it('counts what it cannot read, and goes on', () => {
    link.subscribe('lab/arm0/sample', () => undefined);
    const socket = connect();
    const id = socket.ops().find((one) => one.op === 'subscribe')!.subscriptions![0]!.id;
    socket.say(messageFrame(id, new Uint8Array(3)));
    socket.say(new ArrayBuffer(0));
    socket.onmessage?.({data: '{"op":'} as MessageEvent);
    expect(link.brokenCount).toBe(3);
    expect(link.state.value.phase).toBe('live');
  });

  it('follows a topic to another channel', () => {
    link.subscribe('lab/arm0/sample', () => undefined);
    const socket = connect();
    socket.say({op: 'advertise', channels: [{...kSampled, id: 9}]});
    socket.say({op: 'unadvertise', channelIds: [3]});
    const subscribed = socket.ops().filter((one) => one.op === 'subscribe');
    expect(subscribed.map((one) => one.subscriptions?.[0]?.channelId)).toEqual([3, 9]);
    expect(link.channels.value.get('lab/arm0/sample')?.id).toBe(9);
  });

  it('ends a subscription with its last handler', () => {
    const first = link.subscribe('lab/arm0/sample', () => undefined);
    const second = link.subscribe('lab/arm0/sample', () => undefined);
    const socket = connect();
    first();
    expect(socket.ops().map((one) => one.op)).not.toContain('unsubscribe');
    second();
    expect(socket.ops().map((one) => one.op)).toContain('unsubscribe');
  });

  it('fails calls by the words of the server, a deadline, or a lost connection', async () => {
    const socket = connect();
    const refused = link.call('console/estop', {});
    socket.say({
      op: 'serviceCallFailure',
      serviceId: 7,
      callId: lastCall(socket).id,
      message: 'another browser (connection 3) operates lab/arm0; take over first',
    });
    await expect(refused).rejects.toThrow('another browser (connection 3)');
    const late = link.call('console/estop', {}, 200);
    vi.advanceTimersByTime(200);
    await expect(late).rejects.toThrow('did not answer within 0.2 s');
    const cut = link.call('console/estop', {});
    socket.onclose?.({} as CloseEvent);
    await expect(cut).rejects.toMatchObject({isLost: true});
    await expect(link.call('console/estop', {})).rejects.toMatchObject({isLost: true});
  });
});

describe('Stop', () => {
  it('asks for all devices, and says which were not stopped', async () => {
    const socket = connect();
    const stop = new Stop(link, () => nowMs);
    const pressed = stop.press();
    const call = lastCall(socket);
    expect(call.request).toBe('{}');
    socket.say(reply(call.id, '{"stopped":["a"],"failed":[{"device":"b","why":"no answer"}]}'));
    await pressed;
    expect(stop.report.value).toEqual({
      phase: 'failed',
      words: 'Not stopped: b: no answer.',
      isAnswered: true,
    });
  });

  it('is sent when the connection is back, and says that it was not sent until then', async () => {
    connect().onclose?.({} as CloseEvent);
    const stop = new Stop(link, () => nowMs);
    await stop.press('lab/arm0');
    expect(stop.report.value.phase).toBe('waiting');
    pass(600);
    const socket = connect();
    expect(lastCall(socket).request).toBe('{"device":"lab/arm0"}');
  });

  it('is not sent half a minute later', async () => {
    connect().onclose?.({} as CloseEvent);
    const stop = new Stop(link, () => nowMs);
    await stop.press();
    nowMs += 31_000;
    pass(100);
    const socket = connect();
    expect(socket.sent.some((one) => typeof one !== 'string')).toBe(false);
    expect(stop.report.value.phase).toBe('failed');
  });

  it('has a key that typing does not hit', () => {
    const key = (change: Partial<KeyboardEvent>) =>
      isStopKey({
        code: 'Space',
        ctrlKey: true,
        shiftKey: true,
        altKey: false,
        ...change,
      } as KeyboardEvent);
    expect(key({})).toBe(true);
    expect(key({ctrlKey: false})).toBe(false);
    expect(key({shiftKey: false})).toBe(false);
    expect(key({code: 'Enter'})).toBe(false);
  });
});

describe('frames', () => {
  it('that are cut short are refused', () => {
    const whole = new Uint8Array(reply(1, '{}'));
    for (let size = 0; size < 17; ++size) {
      expect(() => readFrame(whole.slice(0, size))).toThrow(RangeError);
    }
  });
});

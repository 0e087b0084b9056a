import {Decoder, type DecodedTable} from '../flatbuffers/decode';
import {list, number, object, objects, text} from './fields';
import {readFrame, writeRequest} from './frames';
import {parseJson, writeJson, type Json, type JsonObject} from './json';

export interface Channel {
  readonly id: number;
  readonly topic: string;
  readonly encoding: string;
  readonly schemaName: string;
  readonly schema: string;
}

/** A message of a channel. That of a camera has no value, only its payload. */
export interface Message {
  readonly channel: Channel;
  readonly timeNs: bigint;
  readonly payload: Uint8Array;
  readonly value: Json | DecodedTable;
}

export interface ServerInfo {
  readonly name: string;
  readonly metadata: Readonly<Record<string, string>>;
  readonly sessionId: string;
}

/** The part of a WebSocket that the page needs, so that tests bring their own. */
export interface Socket {
  binaryType: string;
  onopen: ((event: Event) => void) | null;
  onclose: ((event: CloseEvent) => void) | null;
  onerror: ((event: Event) => void) | null;
  onmessage: ((event: MessageEvent) => void) | null;
  send(data: string | Uint8Array): void;
  close(): void;
}

export interface Listener {
  onInfo(info: ServerInfo): void;
  onChannels(channels: ReadonlyMap<string, Channel>): void;
  onServices(names: ReadonlySet<string>): void;
  onStatus(level: number, message: string): void;
  onParameters(names: readonly string[]): void;
  /** Anything came. */
  onTraffic(): void;
  onClose(): void;
}

/** A call that failed: the server's own words, or that the connection is lost. */
export class CallError extends Error {
  constructor(
    message: string,
    readonly isLost = false,
  ) {
    super(message);
  }
}

export const kSubprotocols = ['foxglove.sdk.v1', 'foxglove.websocket.v1'];

/** Their bytes are too many to be decoded one by one. */
const kPictureSchemas = new Set(['foxglove.CompressedVideo', 'foxglove.CompressedImage']);

type Handler = (message: Message) => void;
interface OpenCall {
  readonly resolve: (reply: Json) => void;
  readonly reject: (error: CallError) => void;
  readonly timer: ReturnType<typeof setTimeout>;
}

/** One connection's half of the Foxglove WebSocket protocol. A new connection takes a new one. */
export class Client {
  private readonly channels = new Map<string, Channel>();
  private readonly services = new Map<string, number>();
  private readonly subscriptions = new Map<number, {channel: Channel; decoder: Decoder | null}>();
  private readonly subscribed = new Map<string, number>();
  private readonly calls = new Map<number, OpenCall>();
  private lastId = 0;
  private isOpen = false;
  /** Payloads that did not decode, for the page to say so. */
  brokenCount = 0;

  constructor(
    private readonly socket: Socket,
    private readonly listener: Listener,
    private readonly interests: ReadonlyMap<string, ReadonlySet<Handler>>,
  ) {
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => {
      this.isOpen = true;
      listener.onTraffic();
    };
    socket.onmessage = (event) => this.receive(event.data as string | ArrayBuffer);
    socket.onclose = () => this.close();
    socket.onerror = () => undefined; // A close follows.
  }

  /** Subscribes to what is of interest and advertised, and ends other subscriptions. */
  updateSubscriptions(): void {
    if (!this.isOpen) return;
    const wanted: {id: number; channelId: number}[] = [];
    for (const topic of this.interests.keys()) {
      const channel = this.channels.get(topic);
      if (channel === undefined || this.subscribed.has(topic)) continue;
      const id = ++this.lastId;
      this.subscriptions.set(id, {channel, decoder: decoderOf(channel)});
      this.subscribed.set(topic, id);
      wanted.push({id, channelId: channel.id});
    }
    if (wanted.length > 0) this.send({op: 'subscribe', subscriptions: wanted});
    const ended: number[] = [];
    for (const [topic, id] of this.subscribed) {
      if (this.interests.has(topic)) continue;
      this.subscribed.delete(topic);
      this.subscriptions.delete(id);
      ended.push(id);
    }
    if (ended.length > 0) this.send({op: 'unsubscribe', subscriptionIds: ended});
  }

  watchParameters(names: readonly string[]): void {
    if (this.isOpen) this.send({op: 'subscribeParameterUpdates', parameterNames: names});
  }

  /** Rejects with CallError. */
  call(service: string, request: Json, timeoutMs: number): Promise<Json> {
    const serviceId = this.services.get(service);
    if (!this.isOpen) return Promise.reject(new CallError('the connection is lost', true));
    if (serviceId === undefined) {
      return Promise.reject(new CallError(`the console has no service '${service}' at present`));
    }
    return new Promise((resolve, reject) => {
      const callId = ++this.lastId;
      const timer = setTimeout(() => {
        this.calls.delete(callId);
        reject(new CallError(`${service} did not answer within ${timeoutMs / 1000} s`));
      }, timeoutMs);
      this.calls.set(callId, {resolve, reject, timer});
      this.socket.send(writeRequest(serviceId, callId, writeJson(request)));
    });
  }

  close(): void {
    if (this.socket.onclose === null) return;
    this.isOpen = false;
    this.socket.onopen = this.socket.onclose = this.socket.onmessage = null;
    this.socket.close();
    for (const call of this.calls.values()) {
      clearTimeout(call.timer);
      call.reject(new CallError('the connection was lost before the answer came', true));
    }
    this.calls.clear();
    this.listener.onClose();
  }

  private send(message: JsonObject): void {
    this.socket.send(writeJson(message));
  }

  private receive(data: string | ArrayBuffer): void {
    this.listener.onTraffic();
    try {
      if (typeof data === 'string') this.receiveText(object(parseJson(data)));
      else this.receiveBinary(new Uint8Array(data));
    } catch (error) {
      if (!(error instanceof RangeError) && !(error instanceof SyntaxError)) throw error;
      ++this.brokenCount;
    }
  }

  private receiveText(message: JsonObject): void {
    switch (message['op']) {
      case 'serverInfo': {
        const metadata = Object.entries(object(message['metadata']));
        this.listener.onInfo({
          name: text(message['name']),
          metadata: Object.fromEntries(metadata.map(([key, value]) => [key, text(value)])),
          sessionId: text(message['sessionId']),
        });
        break;
      }
      case 'status':
        this.listener.onStatus(number(message['level']), text(message['message']));
        break;
      case 'advertise':
        for (const one of list(message['channels'])) this.addChannel(object(one));
        this.listener.onChannels(this.channels);
        this.updateSubscriptions();
        break;
      case 'unadvertise':
        this.removeChannels(new Set(list(message['channelIds']).map((id) => number(id))));
        this.listener.onChannels(this.channels);
        break;
      case 'advertiseServices':
        for (const one of objects(message['services'])) {
          this.services.set(text(one['name']), number(one['id']));
        }
        this.listener.onServices(new Set(this.services.keys()));
        break;
      case 'unadvertiseServices': {
        const ids = new Set(list(message['serviceIds']).map((id) => number(id)));
        for (const [name, id] of this.services) if (ids.has(id)) this.services.delete(name);
        this.listener.onServices(new Set(this.services.keys()));
        break;
      }
      case 'parameterValues':
        this.listener.onParameters(
          list(message['parameters']).map((one) => text(object(one)['name'])),
        );
        break;
      case 'serviceCallFailure':
        this.finish(number(message['callId']), (call) =>
          call.reject(
            new CallError(text(message['message'], 'the console refused, without words')),
          ),
        );
        break;
    }
  }

  private receiveBinary(bytes: Uint8Array): void {
    const frame = readFrame(bytes);
    if (frame.kind === 'response') {
      const reply = new TextDecoder().decode(frame.payload);
      this.finish(frame.callId, (call) => call.resolve(parseJson(reply === '' ? '{}' : reply)));
    } else if (frame.kind === 'message') {
      const subscription = this.subscriptions.get(frame.subscriptionId);
      if (subscription === undefined) return;
      const {channel, decoder} = subscription;
      const {timeNs, payload} = frame;
      let value: Json | DecodedTable = null;
      if (decoder !== null) value = decoder.decode(payload);
      else if (!kPictureSchemas.has(channel.schemaName))
        value = parseJson(new TextDecoder().decode(payload));
      const handlers = this.interests.get(channel.topic);
      handlers?.forEach((handle) => handle({channel, timeNs, payload, value}));
    }
  }

  private finish(callId: number, how: (call: OpenCall) => void): void {
    const call = this.calls.get(callId);
    if (call === undefined) return;
    clearTimeout(call.timer);
    this.calls.delete(callId);
    how(call);
  }

  private addChannel(one: JsonObject): void {
    const channel = {
      id: number(one['id']),
      topic: text(one['topic']),
      encoding: text(one['encoding']),
      schemaName: text(one['schemaName']),
      schema: text(one['schema']),
    };
    const before = this.channels.get(channel.topic);
    // A topic whose schema became known later goes on as another channel.
    if (before !== undefined && before.id !== channel.id) this.removeChannels(new Set([before.id]));
    this.channels.set(channel.topic, channel);
  }

  private removeChannels(ids: ReadonlySet<number>): void {
    for (const [topic, channel] of this.channels) {
      if (!ids.has(channel.id)) continue;
      this.channels.delete(topic);
      const subscription = this.subscribed.get(topic);
      this.subscribed.delete(topic);
      if (subscription !== undefined) this.subscriptions.delete(subscription);
    }
  }
}

function decoderOf(channel: Channel): Decoder | null {
  if (channel.encoding !== 'flatbuffer' || kPictureSchemas.has(channel.schemaName)) return null;
  const binary = atob(channel.schema);
  return Decoder.of(
    Uint8Array.from(binary, (one) => one.charCodeAt(0)),
    channel.schemaName,
  );
}

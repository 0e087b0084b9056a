import { concat, utf8 } from "../core/bytes.js";
import {
  Suite,
  keySize,
  newKeyPair,
  nonceOf,
  tagSize,
  type Algorithms,
  type KeyPair,
} from "./algorithms.js";

// The handshake Noise_IKpsk2, step by step as in spec/security.md, 3.5.

const noBytes = new Uint8Array(0);
/** The payload of message 1 and of message 2, inside, in bytes. */
export const message1Size = 32 + 48 + 24;
export const message2Size = 32 + 64 + tagSize;

export interface SessionKeys {
  readonly suite: Suite;
  readonly client: Uint8Array;
  readonly server: Uint8Array;
  readonly handshakeHash: Uint8Array;
}

class SymmetricState {
  h: Uint8Array;
  private ck: Uint8Array;
  private k: Uint8Array = noBytes;
  private n = 0n;

  constructor(
    private readonly algorithms: Algorithms,
    readonly suite: Suite,
    prologue: Uint8Array,
    serverKey: Uint8Array,
  ) {
    const cipher = suite === Suite.chaChaPoly ? "ChaChaPoly" : "AESGCM";
    const name = utf8.encode(`Noise_IKpsk2_25519_${cipher}_SHA256`);
    this.ck = this.h = name.length > 32 ? algorithms.sha256(name) : name;
    this.mixHash(prologue);
    this.mixHash(serverKey);
  }

  mixHash(bytes: Uint8Array): void {
    this.h = this.algorithms.sha256(this.h, bytes);
  }
  /** Returns false for a key of small order (sec-2-3). */
  mixDh(privateKey: Uint8Array, publicKey: Uint8Array): boolean {
    const shared = this.algorithms.x25519(privateKey, publicKey);
    if (shared !== undefined) this.mixKey(shared);
    return shared !== undefined;
  }
  mixKey(bytes: Uint8Array): void {
    [this.ck, this.k] = this.derive(bytes);
    this.n = 0n;
  }
  mixKeyAndHash(bytes: Uint8Array): void {
    const [ck, y, k] = this.derive(bytes);
    this.ck = ck;
    this.mixHash(y);
    this.k = k;
    this.n = 0n;
  }
  encrypt(plain: Uint8Array): Uint8Array {
    const nonce = nonceOf(this.suite, this.n++);
    const sealed = this.algorithms.seal(this.suite, this.k, nonce, this.h, plain);
    this.mixHash(sealed);
    return sealed;
  }
  decrypt(sealed: Uint8Array): Uint8Array | undefined {
    const nonce = nonceOf(this.suite, this.n++);
    const plain = this.algorithms.open(this.suite, this.k, nonce, this.h, sealed);
    this.mixHash(sealed);
    return plain;
  }
  keys(): SessionKeys {
    const [client, server] = this.derive(noBytes);
    return { suite: this.suite, client, server, handshakeHash: this.h };
  }

  private derive(bytes: Uint8Array): [Uint8Array, Uint8Array, Uint8Array] {
    const hmac = (key: Uint8Array, ...parts: Uint8Array[]): Uint8Array =>
      this.algorithms.hmacSha256(key, ...parts);
    const t = hmac(this.ck, bytes);
    const d1 = hmac(t, Uint8Array.of(1));
    const d2 = hmac(t, d1, Uint8Array.of(2));
    return [d1, d2, hmac(t, d2, Uint8Array.of(3))];
  }
}

export interface HandshakeConfig {
  readonly algorithms: Algorithms;
  readonly suite: Suite;
  readonly own: KeyPair;
  /** 32 bytes; zeros if there is none. */
  readonly preshared: Uint8Array;
  readonly prologue: Uint8Array;
  /** Drawn anew for each handshake (sec-3-1, sec-3-3); only tests give it. */
  readonly ephemeral?: KeyPair;
}

/** The client's side. */
export class Initiator {
  private readonly state: SymmetricState;
  private readonly ephemeral: KeyPair;

  constructor(
    private readonly config: HandshakeConfig,
    private readonly serverKey: Uint8Array,
  ) {
    const { algorithms, suite, prologue } = config;
    this.ephemeral = config.ephemeral ?? newKeyPair(algorithms);
    this.state = new SymmetricState(algorithms, suite, prologue, serverKey);
  }

  /** Message 1; undefined if the server's key is of small order. */
  writeMessage1(payload: Uint8Array): Uint8Array | undefined {
    const { state, ephemeral, serverKey } = this;
    const { own } = this.config;
    state.mixHash(ephemeral.publicKey);
    state.mixKey(ephemeral.publicKey);
    if (!state.mixDh(ephemeral.privateKey, serverKey)) return undefined;
    const sealedKey = state.encrypt(own.publicKey);
    if (!state.mixDh(own.privateKey, serverKey)) return undefined;
    return concat(ephemeral.publicKey, sealedKey, state.encrypt(payload));
  }

  /** The content of message 2, and the keys; undefined if it is not authentic. */
  readMessage2(message: Uint8Array): { payload: Uint8Array; keys: SessionKeys } | undefined {
    // A message that can't be opened changes nothing (sec-3-4).
    const state: SymmetricState = Object.assign(
      Object.create(SymmetricState.prototype),
      this.state,
    );
    const e = message.subarray(0, keySize);
    state.mixHash(e);
    state.mixKey(e);
    if (!state.mixDh(this.ephemeral.privateKey, e)) return undefined;
    if (!state.mixDh(this.config.own.privateKey, e)) return undefined;
    state.mixKeyAndHash(this.config.preshared);
    const payload = state.decrypt(message.subarray(keySize));
    return payload === undefined ? undefined : { payload, keys: state.keys() };
  }
}

/** The server's side. */
export class Responder {
  private readonly state: SymmetricState;
  private clientEphemeral: Uint8Array = noBytes;
  private clientKey: Uint8Array = noBytes;

  constructor(private readonly config: HandshakeConfig) {
    const { algorithms, suite, prologue, own } = config;
    this.state = new SymmetricState(algorithms, suite, prologue, own.publicKey);
  }

  /** The client's key and what message 1 has inside; undefined if it is not authentic. */
  readMessage1(message: Uint8Array): { clientKey: Uint8Array; payload: Uint8Array } | undefined {
    const { state } = this;
    const { own } = this.config;
    this.clientEphemeral = message.slice(0, keySize);
    state.mixHash(this.clientEphemeral);
    state.mixKey(this.clientEphemeral);
    if (!state.mixDh(own.privateKey, this.clientEphemeral)) return undefined;
    const clientKey = state.decrypt(message.subarray(keySize, keySize + 48));
    if (clientKey === undefined || !state.mixDh(own.privateKey, clientKey)) return undefined;
    const payload = state.decrypt(message.subarray(keySize + 48));
    if (payload === undefined) return undefined;
    this.clientKey = clientKey;
    return { clientKey, payload };
  }

  /** Message 2 and the keys; undefined if the client's ephemeral key is of small order. */
  writeMessage2(payload: Uint8Array): { message: Uint8Array; keys: SessionKeys } | undefined {
    const { state, config } = this;
    const ephemeral = config.ephemeral ?? newKeyPair(config.algorithms);
    state.mixHash(ephemeral.publicKey);
    state.mixKey(ephemeral.publicKey);
    if (!state.mixDh(ephemeral.privateKey, this.clientEphemeral)) return undefined;
    if (!state.mixDh(ephemeral.privateKey, this.clientKey)) return undefined;
    state.mixKeyAndHash(config.preshared);
    const message = concat(ephemeral.publicKey, state.encrypt(payload));
    return { message, keys: state.keys() };
  }
}

/** Bits of features and suites (spec/security.md, section 2). */
export const Suite = { chaChaPoly: 1, aesGcm: 2 } as const;
export type Suite = (typeof Suite)[keyof typeof Suite];

export const keySize = 32;
export const tagSize = 16;

/**
 * The algorithms of sealed sessions. Node's are in `rtpm`; a browser brings its own, as none of its
 * own interfaces is synchronous.
 */
export interface Algorithms {
  /** Bits of the suites that are there; chaChaPoly always is (sec-2-2). */
  readonly suites: number;
  /** Fills bytes with random ones, and returns them. */
  random(bytes: Uint8Array): Uint8Array;
  sha256(...parts: Uint8Array[]): Uint8Array;
  hmacSha256(key: Uint8Array, ...parts: Uint8Array[]): Uint8Array;
  /** The public key of a private one, 32 bytes each. */
  publicKey(privateKey: Uint8Array): Uint8Array;
  /** X25519; undefined where the result is 32 zero bytes (sec-2-3). */
  x25519(privateKey: Uint8Array, publicKey: Uint8Array): Uint8Array | undefined;
  /** The ciphertext, and a tag of 16 bytes behind it. @param nonce  12 bytes */
  seal(
    suite: Suite,
    key: Uint8Array,
    nonce: Uint8Array,
    associated: Uint8Array,
    plain: Uint8Array,
  ): Uint8Array;
  /** undefined if the tag is wrong. */
  open(
    suite: Suite,
    key: Uint8Array,
    nonce: Uint8Array,
    associated: Uint8Array,
    sealed: Uint8Array,
  ): Uint8Array | undefined;
}

export interface KeyPair {
  readonly privateKey: Uint8Array;
  readonly publicKey: Uint8Array;
}

export function keyPairOf(algorithms: Algorithms, privateKey: Uint8Array): KeyPair {
  return { privateKey, publicKey: algorithms.publicKey(privateKey) };
}

export function newKeyPair(algorithms: Algorithms): KeyPair {
  return keyPairOf(algorithms, algorithms.random(new Uint8Array(keySize)));
}

/** The nonce of SEAL (sec-3.5): the suites differ in the order of its bytes. */
export function nonceOf(suite: Suite, counter: bigint): Uint8Array {
  const nonce = new Uint8Array(12);
  new DataView(nonce.buffer).setBigUint64(4, counter, suite === Suite.chaChaPoly);
  return nonce;
}

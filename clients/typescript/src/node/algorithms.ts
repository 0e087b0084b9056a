import {
  createCipheriv,
  createDecipheriv,
  createHash,
  createHmac,
  createPrivateKey,
  createPublicKey,
  diffieHellman,
  randomFillSync,
  type CipherChaCha20Poly1305Types,
  type KeyObject,
} from "node:crypto";
import { isZero, plainBytes } from "../core/bytes.js";
import { Suite, tagSize, type Algorithms } from "../sealed/algorithms.js";

// DER around the raw keys of X25519 (RFC 8410).
const privatePrefix = Buffer.from("302e020100300506032b656e04220420", "hex");
const publicPrefix = Buffer.from("302a300506032b656e032100", "hex");

// OpenSSL computes the public key at once, which is half of a handshake's time. Keys never change.
const privateKeys = new WeakMap<Uint8Array, KeyObject>();

function privateKeyOf(raw: Uint8Array): KeyObject {
  let made = privateKeys.get(raw);
  if (made === undefined) {
    const key = Buffer.concat([privatePrefix, raw]);
    made = createPrivateKey({ key, format: "der", type: "pkcs8" });
    privateKeys.set(raw, made);
  }
  return made;
}
function publicKeyOf(raw: Uint8Array): KeyObject {
  const key = Buffer.concat([publicPrefix, raw]);
  return createPublicKey({ key, format: "der", type: "spki" });
}

// Node's types know no common type of both ciphers; their calls are alike.
function cipherOf(suite: Suite): CipherChaCha20Poly1305Types {
  return (suite === Suite.chaChaPoly ? "chacha20-poly1305" : "aes-256-gcm") as never;
}

/** The algorithms of sealed sessions, by Node's crypto. */
export const nodeAlgorithms: Algorithms = {
  suites: Suite.chaChaPoly | Suite.aesGcm,
  random: (bytes) => randomFillSync(bytes),
  sha256(...parts) {
    const hash = createHash("sha256");
    for (const part of parts) hash.update(part);
    return plainBytes(hash.digest());
  },
  hmacSha256(key, ...parts) {
    const hmac = createHmac("sha256", key);
    for (const part of parts) hmac.update(part);
    return plainBytes(hmac.digest());
  },
  publicKey(privateKey) {
    const der = createPublicKey(privateKeyOf(privateKey)).export({ format: "der", type: "spki" });
    return plainBytes(der.subarray(-32));
  },
  x25519(privateKey, publicKey) {
    try {
      const shared = diffieHellman({
        privateKey: privateKeyOf(privateKey),
        publicKey: publicKeyOf(publicKey),
      });
      return isZero(shared) ? undefined : plainBytes(shared);
    } catch {
      return undefined; // OpenSSL refuses a result of zeros by itself
    }
  },
  seal(suite, key, nonce, associated, plain) {
    const cipher = createCipheriv(cipherOf(suite), key, nonce, { authTagLength: tagSize });
    cipher.setAAD(associated, { plaintextLength: plain.length });
    const sealed = [cipher.update(plain), cipher.final(), cipher.getAuthTag()];
    return plainBytes(Buffer.concat(sealed));
  },
  open(suite, key, nonce, associated, sealed) {
    const end = sealed.length - tagSize;
    if (end < 0) return undefined;
    const cipher = createDecipheriv(cipherOf(suite), key, nonce, { authTagLength: tagSize });
    cipher.setAAD(associated, { plaintextLength: end });
    cipher.setAuthTag(sealed.subarray(end));
    const plain = cipher.update(sealed.subarray(0, end));
    try {
      return plainBytes(Buffer.concat([plain, cipher.final()]));
    } catch {
      return undefined;
    }
  },
};

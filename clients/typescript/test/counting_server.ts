import { Server, keyText, newKeyPair, nodeAlgorithms, parseKey } from "../src/index.js";
import { toHex } from "../src/core/bytes.js";
import { operation, skeleton, type Interface, type Method } from "../src/values/index.js";
import { bytes } from "./support/lab.js";

// The server of "Test a server" in spec/conform/README.md. With public keys, in Base64, as its
// arguments it seals, admits those alone, and prints its own.

const run: Method<Uint8Array, Uint8Array> = {
  name: "run",
  id: 2,
  kind: "call",
  request: bytes,
  reply: bytes,
  fingerprint: 2,
};
const Arm: Interface = { name: "lab.Arm", fingerprint: 1n, methods: [run] };

const admitted = process.argv.slice(2).map((word) => {
  const key = parseKey(`rtpm25519 ${word}`);
  if (key === undefined) throw new Error(`'${word}' is no key`);
  return toHex(key);
});
const own = newKeyPair(nodeAlgorithms);
const keys = { own, admits: (key: Uint8Array) => admitted.includes(toHex(key)) };
const server = await Server.listen(admitted.length === 0 ? {} : { keys });
let count = 0n;
server.add(
  "lab/arm0",
  skeleton(Arm, [
    operation(run, () => {
      count += 1n;
      return new Uint8Array(new BigUint64Array([count]).buffer);
    }),
  ]),
);
if (admitted.length > 0) console.log(keyText(own.publicKey).split(" ")[1]);
console.log(server.addressOf("lab/arm0").replace("rtpm://", "").replace("/lab/arm0", ""));

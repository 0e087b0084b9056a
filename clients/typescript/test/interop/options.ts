import { readFileSync } from "node:fs";
import { parseArgs } from "node:util";
import { keyPairOf, nodeAlgorithms, parseKey, type KeyPair } from "../../src/index.js";

/** The command line of the matrix's programs (tests/interop/README.md). */
export interface Options {
  readonly words: readonly string[];
  readonly transport: "udp" | "tcp";
  readonly registry?: string;
  readonly name?: string;
  readonly device?: string;
  readonly own?: KeyPair;
  /** The other side's public key. */
  readonly other?: Uint8Array;
  readonly isLossy: boolean;
}

export function optionsOf(args: readonly string[]): Options {
  const text = { type: "string" } as const;
  const { values, positionals } = parseArgs({
    args: [...args],
    allowPositionals: true,
    options: {
      transport: text,
      registry: text,
      name: text,
      device: text,
      key: text,
      admit: text,
      "server-key": text,
      lossy: { type: "boolean" },
    },
  });
  const { transport = "udp", registry, name, device, key, lossy = false } = values;
  if (transport !== "udp" && transport !== "tcp") throw new Error("--transport is udp or tcp");
  const other = values.admit ?? values["server-key"];
  return {
    words: positionals,
    transport,
    isLossy: lossy,
    ...(registry === undefined ? {} : { registry }),
    ...(name === undefined ? {} : { name }),
    ...(device === undefined ? {} : { device }),
    ...(key === undefined ? {} : { own: keyPairOf(nodeAlgorithms, readKey(key)) }),
    ...(other === undefined ? {} : { other: keyOf(other) }),
  };
}

function readKey(file: string): Uint8Array {
  return keyOf(readFileSync(file, "utf8"));
}

// A comment may follow the key.
function keyOf(text: string): Uint8Array {
  const key = parseKey(text.trim().split(/\s+/).slice(0, 2).join(" "));
  if (key === undefined) throw new Error("a key is written rtpm25519 and Base64");
  return key;
}

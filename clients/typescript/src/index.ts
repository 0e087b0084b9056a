// The package's export "rtpm": calls, streams and servers in Node.
export * from "./client/index.js";
export { nodeAlgorithms } from "./node/algorithms.js";
export { Node, type NodeKeys, type NodeOptions } from "./node/node.js";
export { Server, type ServerOptions } from "./node/server.js";
export { newKeyPair, keyPairOf, type KeyPair } from "./sealed/algorithms.js";
export { keyFingerprint, keyText, parseKey } from "./sealed/client.js";
export { Refusal } from "./server/dispatcher.js";

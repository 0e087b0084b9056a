// The package's export "rtpm/browser": calls, streams, events and devices in a web page.
export { Node, type NodeOptions } from "./node.js";
export * from "../client/index.js";

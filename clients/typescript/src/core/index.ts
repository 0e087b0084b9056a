// The package's export "rtpm/core": the protocol without I/O, for Node and browsers alike.
export * from "./bytes.js";
export * from "./client_channel.js";
export * from "./clock.js";
export * from "./control.js";
export * from "./counters.js";
export * from "./handshake.js";
export * from "./header.js";
export * from "./numbers.js";
export * from "./peer.js";
export * from "./server_sessions.js";
export * from "./clock_domain.js";
export * from "./discovery.js";
export * from "./interface_text.js";
export * from "./url.js";

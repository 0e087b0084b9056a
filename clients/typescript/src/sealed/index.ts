// The package's export "rtpm/sealed": sealed sessions without I/O.
export * from "./algorithms.js";
export * from "./client.js";
export * from "./frames.js";
export * from "./server.js";
export * from "./session.js";

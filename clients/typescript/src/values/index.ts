// The package's export "rtpm/values", which generated code imports.
export * from "./caller.js";
export * from "./codec.js";
export * from "./codecs.js";
export * from "./method.js";
export * from "./numbers.js";
export * from "./reader.js";
export * as scalars from "./scalars.js";
export * from "./skeleton.js";
export * from "./writer.js";

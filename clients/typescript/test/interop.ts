import { check } from "./interop/check.js";
import { optionsOf } from "./interop/options.js";
import { serve } from "./interop/serve.js";

// This language's program of the matrix (tests/interop/README.md).

const options = optionsOf(process.argv.slice(2));
const [verb, url] = options.words;
if (verb === "serve") {
  await serve(options);
} else if (verb === "check" && url !== undefined) {
  process.exitCode = (await check(url, options)) ? 0 : 1;
} else {
  process.stderr.write("interop: usage: interop serve …, or interop check URL …\n");
  process.exitCode = 2;
}

// Lets browsers load the generated modules of this package without an import map:
// node relative_imports.mjs FOLDER
import { readdirSync, readFileSync, writeFileSync } from "node:fs";
import { dirname, join, relative } from "node:path";

const [folder] = process.argv.slice(2);
for (const name of readdirSync(folder, { recursive: true })) {
  if (!/\.(js|d\.ts)$/.test(name)) continue;
  const file = join(folder, name);
  const values = relative(dirname(file), join(folder, "../src/values/index.js"));
  const text = readFileSync(file, "utf8");
  const moved = text.replace(/from "rtpm\/values";/, `from "${values}";`);
  if (moved !== text) writeFileSync(file, moved);
}

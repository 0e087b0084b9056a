import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { test } from "node:test";

test("what browsers load imports nothing of Node", async () => {
  const seen = new Set<string>();
  const visit = async (url: URL): Promise<void> => {
    if (seen.has(url.href)) return;
    seen.add(url.href);
    const text = await readFile(url, "utf8");
    for (const [, from] of text.matchAll(/(?:from|import) "([^"]+)";/g)) {
      assert.match(from!, /^\.\.?\/.*\.js$/, `${url.pathname} imports ${from}`);
      await visit(new URL(from!, url));
    }
  };
  await visit(new URL("../src/browser/index.js", import.meta.url));
  assert.ok(seen.size > 30);
});

import assert from "node:assert/strict";
import { test } from "node:test";
import { play, type Role } from "./support/player.js";
import { conversationNames, readVectors, type Json } from "./support/vectors.js";

// spec/vectors/conversations: our client and our server each do what the vectors say.

for (const name of conversationNames()) {
  const conversation = readVectors(`conversations/${name}.json`);
  if (conversation.level === "bindings") continue; // see bindings.test.ts
  for (const role of conversation.roles as Role[]) {
    test(`${name} as ${role}`, () => {
      assert.ok(conversation.steps.length > 0);
      assert.equal(play(conversation, role), "");
    });
  }
}

// A blind player would take everything: each of these is a lie about our code.
for (const name of ["lost-call", "large-request", "oneways", "stream", "server-stops"]) {
  test(`the player sees deviations from ${name}`, () => {
    const good = readVectors(`conversations/${name}.json`);
    for (const role of ["client", "server"] as const) {
      (good.steps as Json[]).forEach((step, i) => {
        const isOutput = step.frame?.startsWith(role) === true || step[`${role}_sees`];
        if (!isOutput) return;
        const missing = { ...good, steps: good.steps.toSpliced(i, 1) };
        assert.notEqual(play(missing, role), "", `${role}, without step ${i}`);
        const twice = { ...good, steps: good.steps.toSpliced(i, 0, step) };
        assert.notEqual(play(twice, role), "", `${role}, with step ${i} twice`);
        if (step.hex === undefined) return;
        const changed = { ...step, hex: `5${step.hex.slice(1)}` };
        const other = { ...good, steps: good.steps.toSpliced(i, 1, changed) };
        assert.notEqual(play(other, role), "", `${role}, with another step ${i}`);
      });
    }
  });
}

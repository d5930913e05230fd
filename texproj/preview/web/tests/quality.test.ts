// Coarse only where full frames proved slow, fine only at rest.

import assert from "node:assert/strict";
import { test } from "node:test";
import { COARSE, FINE, PLAIN, Quality } from "../src/quality.ts";

test("a fast machine moves plainly and rests finely", () => {
  const quality = new Quality();
  assert.deepEqual([1000, 1016, 1032].map((now) => quality.at(now, now)), [PLAIN, PLAIN, PLAIN]);
  assert.equal(quality.at(1400, 1032), PLAIN);
  assert.equal(quality.at(2000, 1032), FINE);
});

test("a slow one is coarse from its first slow frame on, while it moves", () => {
  const quality = new Quality();
  quality.at(1000, 1000);
  assert.equal(quality.at(1100, 1100), COARSE);
  assert.equal(quality.at(2000, 1100), FINE);
  assert.equal(quality.at(2016, 2016), COARSE);
});

test("a pause between two moves is no slow frame", () => {
  const quality = new Quality();
  quality.at(1000, 1000);
  quality.at(1300, 1000);
  assert.equal(quality.at(5000, 5000), PLAIN);
});

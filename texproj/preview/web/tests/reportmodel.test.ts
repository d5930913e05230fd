import assert from "node:assert/strict";
import { test } from "node:test";
import type { Packed } from "../src/reportmodel.ts";
import { clipFromModel, summed } from "../src/reportmodel.ts";

const BOX: Packed = {
  up: [0, 0, 1], front: [0, -1, 0], low: [0, 0, 0], size: [2, 2, 2],
  positions: "", uv: null, colors: null, faces: "", pages: [],
};

/** Normalized device coordinates of a point of the unit box. */
function seen(point: number[], turn = 0, rise = 0): number[] {
  const m = clipFromModel(BOX, { turn, rise, distance: 2 }, 1.5);
  const row = (k: number) => m[k] * point[0] + m[4 + k] * point[1] + m[8 + k] * point[2] + m[12 + k];
  return [0, 1, 2].map((k) => row(k) / row(3));
}

test("the middle is in the middle, up is up, and the front is nearer than the back", () => {
  const [x, y, z] = seen([0.5, 0.5, 0.5], 0.3, 0.4);
  assert.ok(Math.abs(x) < 1e-6 && Math.abs(y) < 1e-6 && Math.abs(z) < 1);
  assert.ok(seen([0.5, 0.5, 1])[1] > 0.1);
  assert.ok(seen([0.5, 0, 0.5])[2] < seen([0.5, 1, 0.5])[2]);
});

test("from the front x is to the right, and a turn of half a circle swaps it", () => {
  assert.ok(seen([1, 0.5, 0.5])[0] > 0.1);
  assert.ok(seen([1, 0.5, 0.5], Math.PI)[0] < -0.1);
});

test("everything is inside of the near and the far plane", () => {
  for (let i = 0; i < 8; i++) {
    const z = seen([i & 1, (i >> 1) & 1, i >> 2], 0.7, 0.5)[2];
    assert.ok(z > -1 && z < 1);
  }
});

test("running sums", () => {
  assert.deepEqual([...summed(new Int32Array([3, -2, 4]))], [3, 1, 5]);
});

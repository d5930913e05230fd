// The lens: pixels to rays and back, and where it ends.

import assert from "node:assert/strict";
import { test } from "node:test";
import type { Camera } from "../src/lens.ts";
import { center, distort, ideal, project, sidesOfPhoto } from "../src/lens.ts";

const CAMERA: Camera = {
  width: 640, height: 480, f: [610, 606], c: [350, 215], dist: [-0.12, 0.05, 0.002, -0.0015, 0],
  model: "perspective" as const, max_radius: 1.2, R: [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], t: [0.5, -0.25, 2],
};

test("a ray through a pixel comes back to it, through distortion", () => {
  for (const [u, v] of [[0, 0], [640, 480], [350, 215], [17.25, 400.5]]) {
    const [x, y] = ideal(CAMERA, u, v)!;
    const p = [x * 3 - 0.5, y * 3 + 0.25, 3 - 2];
    const world = [0, 1, 2].map((k) => CAMERA.R[0][k] * p[0] + CAMERA.R[1][k] * p[1] + CAMERA.R[2][k] * p[2]);
    const back = project(CAMERA, world as [number, number, number])!;
    assert.ok(Math.hypot(back[0] - u, back[1] - v) < 1e-6);
  }
});

test("nothing is seen behind the camera, nor beyond where the lens folds back", () => {
  const [x, y, z] = center(CAMERA);
  assert.equal(project(CAMERA, [x, y, z - 1]), null);
  assert.equal(project(CAMERA, [x + 5, y, z + 1]), null);
});

test("the center is where the pose puts it", () => {
  const at = center(CAMERA);
  CAMERA.R.forEach((row, i) => assert.ok(Math.abs(row.reduce((s, r, k) => s + r * at[k], 0) + CAMERA.t[i]) < 1e-12));
});

test("the window of a photo holds all its corners", () => {
  const { left, right, bottom, top } = sidesOfPhoto(CAMERA);
  for (const [u, v] of [[0, 0], [640, 0], [0, 480], [640, 480]]) {
    const [x, y] = ideal(CAMERA, u, v)!;
    assert.ok(x >= left && x <= right && -y >= bottom && -y <= top);
  }
});

test("a fisheye is that of texproj/fisheye.py, and comes back", () => {
  const fisheye: Camera = {
    ...CAMERA, model: "fisheye", dist: [0.03, -0.01, 0.002, -0.0003, 0.001, -0.002, 0.003, -0.001],
    max_radius: Math.tan((75 * Math.PI) / 180),
  };
  const [x, y] = distort(fisheye, 1.2, -0.7)!;
  assert.ok(Math.hypot(x - 0.8317934390309198, y - -0.48468981726254734) < 1e-12);
  const back = ideal(fisheye, x * 610 + 350, y * 606 + 215)!;
  assert.ok(Math.hypot(back[0] - 1.2, back[1] + 0.7) < 1e-9);
  assert.equal(distort(fisheye, 4, 0), null);
});

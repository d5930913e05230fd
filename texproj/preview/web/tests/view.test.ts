// Windows on a photo's plane and the canvas they are drawn on.

import assert from "node:assert/strict";
import { test } from "node:test";
import * as THREE from "three";
import type { Camera } from "../src/lens.ts";
import { levelled, pixelOfWindow, pointOf, sidesOfAngle, sidesOfWindow, tangentsAt, windowAt } from "../src/view.ts";

const CAMERA: Camera = {
  width: 640, height: 480, f: [610, 606], c: [350, 215], dist: [-0.12, 0.05], model: "perspective" as const, max_radius: null,
  R: [[1, 0, 0], [0, 1, 0], [0, 0, 1]], t: [0, 0, 0],
};

test("a point of the canvas comes back to itself", () => {
  const sides = sidesOfWindow({ x: 0.1, y: -0.2, scale: 500 }, [800, 600]);
  const [x, y] = pointOf(tangentsAt([123, 456], sides, [800, 600]), sides, [800, 600]);
  assert.ok(Math.hypot(x - 123, y - 456) < 1e-9);
});

test("the window around a pixel has that pixel in its middle, at the scale asked for", () => {
  const window = windowAt(CAMERA, [100, 400], 2)!;
  const [u, v] = pixelOfWindow(CAMERA, window)!;
  assert.ok(Math.hypot(u - 100, v - 400) < 1e-6);
  assert.equal(window.scale, 2 * 610);
});

test("the angle spans the shorter edge", () => {
  const wide = sidesOfAngle(36, 2);
  const tall = sidesOfAngle(36, 0.5);
  assert.ok(Math.abs(wide.top - tall.right) < 1e-12);
  assert.ok(Math.abs(wide.right - 2 * wide.top) < 1e-12);
});

test("another way up leaves the distance, and never looks along itself", () => {
  const [y, z] = [new THREE.Vector3(0, 1, 0), new THREE.Vector3(0, 0, 1)];
  assert.deepEqual(levelled(new THREE.Vector3(5, 0, 1), y, z).toArray(), [5, 0, 1]);
  const found = levelled(new THREE.Vector3(0, 0, 6), y, z);
  assert.ok(Math.abs(found.length() - 6) < 1e-9);
  assert.ok(found.dot(z) < 0.9 * 6);
});

import assert from "node:assert/strict";
import { test } from "node:test";
import * as THREE from "three";
import { irradiance, metered } from "../src/lightmath.ts";

const ZERO = [0, 0, 0] as [number, number, number];

/** Irradiance of a sky of radiance 1 in all directions: pi, whatever the normal. */
const EVEN = [[Math.PI / 0.28209479, Math.PI / 0.28209479, Math.PI / 0.28209479], ...Array.from({ length: 8 }, () => ZERO)] as [number, number, number][];

test("an even sky lights all normals alike", () => {
  for (const n of [[0, 0, 1], [0.6, 0, -0.8]] as [number, number, number][]) {
    assert.ok(irradiance(EVEN, n).every((e) => Math.abs(e - Math.PI) < 1e-9));
  }
});

test("the mean is exposed to a gray card's", () => {
  const sample = { base: Float32Array.from([0.5, 0.5, 0.5, 0.5, 0.5, 0.5]), normals: Float32Array.from([0, 0, 1, 0, 0, -1]) };
  const sun = new THREE.Vector3(0, 0, 1);
  assert.ok(Math.abs(metered(sample, EVEN, sun, new THREE.Vector3()) * 0.5 - 0.18) < 1e-6);
  // the sun reaches one of the two
  const lit = new THREE.Vector3(Math.PI, Math.PI, Math.PI);
  assert.ok(Math.abs(metered(sample, EVEN, sun, lit) * 0.75 - 0.18) < 1e-6);
  assert.equal(metered({ base: new Float32Array(), normals: new Float32Array() }, EVEN, sun, lit), 1);
});

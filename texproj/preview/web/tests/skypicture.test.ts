import assert from "node:assert/strict";
import { test } from "node:test";
import { DataUtils } from "three";
import { irradiance } from "../src/lightmath.ts";
import type { SkyPicture } from "../src/skypicture.ts";
import { irradianceOf, lookedUp, MIRROR, mirrored, parted, pictureOf } from "../src/skypicture.ts";

const AXES = { right: [1, 0, 0], up: [0, 0, 1], ahead: [0, 1, 0] } as { right: [number, number, number]; up: [number, number, number]; ahead: [number, number, number] };

function painted(width: number, color: (right: number, up: number, ahead: number) => number[]): SkyPicture {
  const height = width / 2;
  const rgb = new Float32Array(3 * width * height);
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < width; x++) {
      const above = Math.PI / 2 - ((y + 0.5) / height) * Math.PI;
      const around = ((x + 0.5) / width) * 2 * Math.PI - Math.PI;
      rgb.set(color(Math.cos(above) * Math.sin(around), Math.sin(above), Math.cos(above) * Math.cos(around)), 3 * (y * width + x));
    }
  }
  return { width, height, rgb };
}

test("directions are to the right, up and ahead", () => {
  const sky = painted(64, (right, up, ahead) => [right + 1, up + 1, ahead + 1]);
  for (const d of [[0.6, 0, 0.8], [0, -0.8, 0.6], [-0.48, 0.6, -0.64]] as [number, number, number][]) {
    lookedUp(sky, ...d, [0, 0, 0]).forEach((value, k) => assert.ok(Math.abs(value - 1 - d[k]) < 0.01));
  }
});

test("half a sky lights level ground by pi, a wall by half of it", () => {
  const sums = irradianceOf(painted(128, (_, up) => (up > 0 ? [1, 1, 1] : [0, 0, 0])), AXES);
  assert.ok(Math.abs(irradiance(sums, [0, 0, 1])[0] - Math.PI) < 0.2);
  assert.ok(Math.abs(irradiance(sums, [1, 0, 0])[0] - Math.PI / 2) < 0.05);
  const back = irradianceOf(pictureOf(sums, AXES), AXES);
  assert.ok(Math.abs(irradiance(back, [0, 0, 1])[0] - Math.PI) < 0.25);
});

test("a sun is parted from its sky, with its light", () => {
  const toward = [0.36, 0.48, 0.8];
  const sun = (x: number, y: number, z: number) => x * toward[0] + y * toward[1] + z * toward[2] > Math.cos(0.035);
  const { rest, sun: found } = parted(painted(512, (x, y, z) => (sun(x, y, z) ? [50000, 50000, 50000] : [1, 1, 1])));
  assert.ok(found!.toward.every((value, k) => Math.abs(value - toward[k]) < 0.005));
  const solid = 2 * Math.PI * (1 - Math.cos(0.035));
  assert.ok(Math.abs(found!.irradiance[0] / (50000 * solid) - 1) < 0.05);
  assert.ok(rest.rgb.every((value) => Math.abs(value - 1) < 1e-6));
  assert.equal(parted(painted(64, () => [1, 1, 1])).sun, null);
});

test("the rougher a mirror, the more even what it shows", () => {
  const { data, unit } = mirrored(painted(128, (right) => (right > 0 ? [2, 2, 2] : [0, 0, 0])));
  assert.ok(Math.abs(unit - 1) < 0.01);
  const { width, height, layers } = MIRROR;
  const at = (layer: number, x: number) => DataUtils.fromHalfFloat(data[4 * ((layer * height + height / 2) * width + x)]);
  const contrast = Array.from({ length: layers }, (_, layer) => at(layer, (width * 9) / 16) - at(layer, (width * 7) / 16));
  assert.ok(Math.abs(contrast[0] - 2) < 0.01);
  for (let layer = 1; layer < layers; layer++) assert.ok(contrast[layer] <= contrast[layer - 1] + 1e-3);
  assert.ok(contrast[layers - 1] < 1.6 && contrast[layers - 1] > 0.4);
});

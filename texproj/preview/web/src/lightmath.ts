// How much light comes to a surface, and how it is exposed.

import type * as THREE from "three";
import type { Vec3 } from "./lens.ts";

/** What the mean luminance is exposed to: a gray card's. */
const KEY = 0.18;
const LUMINANCE = [0.2126, 0.7152, 0.0722];

/** A sample of the surface: linear base colors and normals. */
export interface Sample {
  base: Float32Array;
  normals: Float32Array;
}

/** What puts the mean luminance at a gray card's, as a camera meters. */
export function metered({ base, normals }: Sample, sky: Vec3[], toSun: THREE.Vector3, sunlight: THREE.Vector3): number {
  let total = 0;
  const count = base.length / 3;
  for (let i = 0; i < base.length; i += 3) {
    const n: Vec3 = [normals[i], normals[i + 1], normals[i + 2]];
    const lit = Math.max(toSun.x * n[0] + toSun.y * n[1] + toSun.z * n[2], 0);
    const from = irradiance(sky, n);
    const sun = sunlight.toArray();
    for (let k = 0; k < 3; k++) total += (LUMINANCE[k] * base[i + k] * (Math.max(from[k], 0) + lit * sun[k])) / Math.PI;
  }
  return total > 0 ? (KEY * count) / total : 1;
}

/** Irradiance of an open surface with normal `n`; twin: surface.frag.glsl, texproj/appearance/harmonics.py. */
export function irradiance(sky: Vec3[], [x, y, z]: Vec3): Vec3 {
  const basis = [
    0.28209479, 0.48860251 * y, 0.48860251 * z, 0.48860251 * x, 1.09254843 * x * y, 1.09254843 * y * z,
    0.31539157 * (3 * z * z - 1), 1.09254843 * x * z, 0.54627422 * (x * x - y * y),
  ];
  return [0, 1, 2].map((k) => basis.reduce((sum, value, i) => sum + value * sky[i][k], 0)) as Vec3;
}

export const luminance = (rgb: Vec3) => rgb.reduce((sum, value, k) => sum + LUMINANCE[k] * value, 0);

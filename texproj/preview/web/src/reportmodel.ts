// The model inside a report: packed by texproj/report/model.py.

import type { Vec3 } from "./lens.ts";

/** As it stands in the page. Arrays are base64 of deflated little-endian numbers. */
export interface Packed {
  up: Vec3;
  front: Vec3;
  low: Vec3;
  size: Vec3;
  /** uint16, three a vertex: parts of `size`. */
  positions: string;
  /** uint16, two a vertex: parts of a page, from its top left corner. */
  uv: string | null;
  /** uint8, three a vertex, sRGB. */
  colors: string | null;
  /** int32, three a triangle, each less the one before it. */
  faces: string;
  pages: Page[];
}

/** Triangles that share an image; null for those without one. */
export interface Page {
  image: string | null;
  first: number;
  count: number;
}

export interface Model {
  positions: Uint16Array;
  uv: Uint16Array | null;
  colors: Uint8Array | null;
  faces: Uint32Array;
}

export async function unpacked(packed: Packed): Promise<Model> {
  const [positions, uv, colors, steps] = await Promise.all(
    [packed.positions, packed.uv, packed.colors, packed.faces].map((text) => text && inflated(text)),
  );
  return {
    positions: new Uint16Array(positions as ArrayBuffer),
    uv: uv ? new Uint16Array(uv) : null,
    colors: colors ? new Uint8Array(colors) : null,
    faces: summed(new Int32Array(steps as ArrayBuffer)),
  };
}

/** Running sums. */
export function summed(steps: Int32Array): Uint32Array {
  const out = new Uint32Array(steps.length);
  for (let i = 0, sum = 0; i < steps.length; i++) out[i] = sum += steps[i];
  return out;
}

async function inflated(text: string): Promise<ArrayBuffer> {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(stream).arrayBuffer();
}

/** Where a viewer is that goes around a model: angles in radians, distance in sizes of it. */
export interface Orbit {
  turn: number;
  rise: number;
  distance: number;
}

/** Half the angle of view along the shorter side, radians. */
const HALF_VIEW = 0.3;
/** The steepest rise: from the pole itself no direction is up. */
export const STEEPEST = 1.55;

/** Column-major matrix from the model's unit box to clip space. aspect: width over height. */
export function clipFromModel(packed: Packed, orbit: Orbit, aspect: number): Float32Array {
  const { up, front, size } = packed;
  const side = cross(up, front);
  const reach = Math.hypot(...size);
  const level = mix(front, Math.cos(orbit.turn), side, Math.sin(orbit.turn));
  const back = mix(level, Math.cos(orbit.rise), up, Math.sin(orbit.rise));
  const right = unit(cross(up, back));
  const upward = cross(back, right);
  const distance = orbit.distance * reach;
  const [near, far] = [Math.max(distance - reach, 0.01 * reach), distance + reach];
  const focal = 1 / Math.tan(HALF_VIEW) * Math.min(1, aspect);
  const scales = [focal / aspect, focal];
  // rows of camera-from-model: R (size * p - size / 2) - distance along the axis that looks back
  const rows = [right, upward, back].map((axis, k) => {
    const shift = -0.5 * dot(axis, size) - (k === 2 ? distance : 0);
    return [axis[0] * size[0], axis[1] * size[1], axis[2] * size[2], shift];
  });
  const out = new Float32Array(16);
  for (let i = 0; i < 4; i++) {
    out[4 * i] = scales[0] * rows[0][i];
    out[4 * i + 1] = scales[1] * rows[1][i];
    out[4 * i + 2] = (-(far + near) / (far - near)) * rows[2][i] - (i === 3 ? (2 * far * near) / (far - near) : 0);
    out[4 * i + 3] = -rows[2][i];
  }
  return out;
}

function mix(a: Vec3, p: number, b: Vec3, q: number): Vec3 {
  return [0, 1, 2].map((k) => a[k] * p + b[k] * q) as Vec3;
}

function cross(a: Vec3, b: Vec3): Vec3 {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

function dot(a: Vec3, b: Vec3): number {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

function unit(a: Vec3): Vec3 {
  const length = Math.hypot(...a) || 1;
  return a.map((v) => v / length) as Vec3;
}

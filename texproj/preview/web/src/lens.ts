// The camera model of texproj/camera.py: pixels count from the photo's corner, x right, y down,
// z forward; OpenCV's distortion k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4, or a fisheye's.

export type Vec2 = [number, number];
export type Vec3 = [number, number, number];

/** A photo's camera as the server sends it. f, c: pixels; R, t: cam_from_world. */
export interface Camera {
  width: number;
  height: number;
  f: Vec2;
  c: Vec2;
  dist: number[];
  model: "perspective" | "fisheye";
  max_radius: number | null;
  R: [Vec3, Vec3, Vec3];
  t: Vec3;
}

/** Sides of a view as tangents at distance 1; top > bottom in a three.js camera (y up). */
export interface Sides {
  left: number;
  right: number;
  bottom: number;
  top: number;
}

const STEPS = 30;

/** Ideal (x/z, y/z) to distorted normalized coordinates; null where the lens model folds back. */
export function distort(camera: Camera, x: number, y: number): Vec2 | null {
  const r2 = x * x + y * y;
  if (camera.max_radius !== null && r2 >= camera.max_radius ** 2) return null;
  if (camera.model === "fisheye") return bentFisheye(camera.dist, x, y);
  const [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4] = padded(camera.dist);
  const radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)));
  return [
    x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x) + r2 * (s1 + r2 * s2),
    y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y + r2 * (s3 + r2 * s4),
  ];
}

/** The fisheye model of texproj/fisheye.py: k1 k2 k3 k4 [p1 p2 s1 s2]. */
function bentFisheye(dist: number[], x: number, y: number): Vec2 {
  const [k1, k2, k3, k4, p1, p2, s1, s2] = padded(dist);
  const r = Math.hypot(x, y);
  const shrink = r > 0 ? Math.atan(r) / r : 1;
  const [u, v] = [x * shrink, y * shrink];
  const t2 = u * u + v * v;
  const radial = 1 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4)));
  return [
    u * radial + 2 * p1 * u * v + p2 * (t2 + 2 * u * u) + s1 * t2,
    v * radial + 2 * p2 * u * v + p1 * (t2 + 2 * v * v) + s2 * t2,
  ];
}

/** The coefficients, missing ones zero. */
export function padded(dist: number[]): number[] {
  return Array.from({ length: 12 }, (_, i) => dist[i] ?? 0);
}

/** Pixel to ideal (x/z, y/z), by Newton's method; null where it does not converge. */
export function ideal(camera: Camera, u: number, v: number): Vec2 | null {
  const target: Vec2 = [(u - camera.c[0]) / camera.f[0], (v - camera.c[1]) / camera.f[1]];
  let [x, y] = startOf(camera, target);
  for (let i = 0; i < STEPS; i++) {
    const step = newtonStep(camera, x, y, target);
    if (!step) return null;
    x -= step[0];
    y -= step[1];
    if (Math.hypot(...step) < 1e-12) return [x, y];
  }
  return null;
}

function startOf(camera: Camera, target: Vec2): Vec2 {
  const radius = Math.hypot(...target);
  const limit = 0.9 * (camera.max_radius ?? Infinity);
  const shrink = radius > limit ? limit / radius : 1;
  return [target[0] * shrink, target[1] * shrink];
}

function newtonStep(camera: Camera, x: number, y: number, target: Vec2): Vec2 | null {
  const h = 1e-6;
  const at = distort(camera, x, y);
  const dx = distort(camera, x + h, y);
  const dy = distort(camera, x, y + h);
  if (!at || !dx || !dy) return null;
  const [a, c] = [(dx[0] - at[0]) / h, (dx[1] - at[1]) / h];
  const [b, d] = [(dy[0] - at[0]) / h, (dy[1] - at[1]) / h];
  const [ex, ey] = [at[0] - target[0], at[1] - target[1]];
  const det = a * d - b * c;
  return [(d * ex - b * ey) / det, (a * ey - c * ex) / det];
}

/** World point to pixel; null behind the camera or outside of the lens model. */
export function project(camera: Camera, p: Vec3): Vec2 | null {
  const [x, y, z] = camera.R.map((row, i) => dot(row, p) + camera.t[i]) as Vec3;
  const xy = z > 0 ? distort(camera, x / z, y / z) : null;
  return xy && [xy[0] * camera.f[0] + camera.c[0], xy[1] * camera.f[1] + camera.c[1]];
}

/** Projection center, world. */
export function center(camera: Camera): Vec3 {
  return [0, 1, 2].map(
    (k) => -(camera.R[0][k] * camera.t[0] + camera.R[1][k] * camera.t[1] + camera.R[2][k] * camera.t[2]),
  ) as Vec3;
}

/** The smallest window, as tangents with y up, that shows every pixel of the photo. */
export function sidesOfPhoto(camera: Camera): Sides {
  const border: Vec2[] = [];
  for (let i = 0; i <= 16; i++) {
    const [u, v] = [(camera.width * i) / 16, (camera.height * i) / 16];
    border.push([u, 0], [u, camera.height], [0, v], [camera.width, v]);
  }
  const found = border.map(([u, v]) => ideal(camera, u, v)).filter((p) => p !== null);
  const [xs, ys] = [found.map((p) => p[0]), found.map((p) => p[1])];
  return {
    left: Math.min(...xs),
    right: Math.max(...xs),
    bottom: -Math.max(...ys),
    top: -Math.min(...ys),
  };
}

function dot(a: Vec3, b: Vec3): number {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// Which way a model stands and from where it is seen first.

import type { Vec3 } from "./lens.ts";

export type Axis = "x" | "y" | "z" | "-x" | "-y" | "-z";

export const AXES: Axis[] = ["x", "y", "z", "-x", "-y", "-z"];

export function vectorOf(axis: Axis): Vec3 {
  const sign = axis.startsWith("-") ? -1 : 1;
  return ["x", "y", "z"].map((name) => (axis.endsWith(name) ? sign : 0)) as Vec3;
}

/** The axis nearest to a direction. */
export function axisOf(direction: Vec3): Axis {
  const along = (axis: Axis) => dot(vectorOf(axis), direction);
  return [...AXES].sort((a, b) => along(b) - along(a))[0];
}

/** Part of the whole area that must be left over for a surface to have a front. */
const OPEN = 0.15;

/**
 * The side that most of the surface faces (unit), null where it faces all sides alike.
 * positions: three numbers a vertex; faces: three vertices each, counterclockwise from outside.
 */
export function frontOf(positions: ArrayLike<number>, faces: ArrayLike<number>): Vec3 | null {
  const sum: Vec3 = [0, 0, 0];
  let area = 0;
  for (let i = 0; i < faces.length; i += 3) {
    const [a, b, c] = [faces[i] * 3, faces[i + 1] * 3, faces[i + 2] * 3];
    const [ux, uy, uz] = [0, 1, 2].map((k) => positions[b + k] - positions[a + k]);
    const [vx, vy, vz] = [0, 1, 2].map((k) => positions[c + k] - positions[a + k]);
    const normal: Vec3 = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    for (let k = 0; k < 3; k++) sum[k] += normal[k];
    area += Math.hypot(...normal);
  }
  const length = Math.hypot(...sum);
  return length > OPEN * area ? (sum.map((v) => v / length) as Vec3) : null;
}

/**
 * The axis that is up, guessed without cameras: z, unless the front looks along it. Then the scan
 * stands in the frame of a camera: y is up before it (OpenGL) or down (OpenCV).
 */
export function guessedUp(front: Vec3 | null): Axis {
  if (!front || Math.abs(front[2]) < 0.8) return "z";
  return front[2] > 0 ? "y" : "-y";
}

function dot(a: Vec3, b: Vec3): number {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// Where a view looks from, and what part of its image plane it shows.

import * as THREE from "three";
import type { Camera, Sides, Vec2 } from "./lens.ts";
import { center, distort, ideal } from "./lens.ts";

export interface Pose {
  position: THREE.Vector3;
  quaternion: THREE.Quaternion;
  sides: Sides;
}

/** Part of a photo's ideal plane on screen: middle (tangents, y up) and pixels per tangent. */
export interface Window {
  x: number;
  y: number;
  scale: number;
}

/** The sides that a window shows on a canvas of `size`. */
export function sidesOfWindow({ x, y, scale }: Window, [w, h]: Vec2): Sides {
  return { left: x - w / 2 / scale, right: x + w / 2 / scale, bottom: y - h / 2 / scale, top: y + h / 2 / scale };
}

/** The sides of a centered view whose shorter edge spans an angle. */
export function sidesOfAngle(angleDeg: number, aspect: number): Sides {
  const top = Math.tan((angleDeg * Math.PI) / 360) / Math.min(1, aspect);
  return { left: -top * aspect, right: top * aspect, bottom: -top, top };
}

/** Position (scene frame: world less `origin`) and orientation of a photo's camera, y up. */
export function poseOfCamera(camera: Camera, origin: THREE.Vector3, sides: Sides): Pose {
  const [x, y, z] = camera.R.map((row) => new THREE.Vector3(...row));
  const basis = new THREE.Matrix4().makeBasis(x, y.negate(), z.negate());
  return {
    position: new THREE.Vector3(...center(camera)).sub(origin),
    quaternion: new THREE.Quaternion().setFromRotationMatrix(basis),
    sides,
  };
}

/** Tangents at a point of a canvas of `size`. */
export function tangentsAt(at: Vec2, { left, right, bottom, top }: Sides, [w, h]: Vec2): Vec2 {
  return [left + (at[0] / w) * (right - left), top - (at[1] / h) * (top - bottom)];
}

/** The inverse of `tangentsAt`. */
export function pointOf([x, y]: Vec2, { left, right, bottom, top }: Sides, [w, h]: Vec2): Vec2 {
  return [((x - left) / (right - left)) * w, (1 - (y - bottom) / (top - bottom)) * h];
}

export function mixSides(a: Sides, b: Sides, t: number): Sides {
  const mix = (p: number, q: number) => p + (q - p) * t;
  return {
    left: mix(a.left, b.left), right: mix(a.right, b.right),
    bottom: mix(a.bottom, b.bottom), top: mix(a.top, b.top),
  };
}

export function clamp(value: number, low: number, high: number): number {
  return Math.min(Math.max(value, low), high);
}

/** Photo pixel in the middle of a window; null outside of the lens model. */
export function pixelOfWindow(camera: Camera, { x, y }: Window): Vec2 | null {
  const xy = distort(camera, x, -y);
  return xy && [xy[0] * camera.f[0] + camera.c[0], xy[1] * camera.f[1] + camera.c[1]];
}

/** The window that shows photo pixel `uv` in the middle at `scale` screen pixels per photo pixel. */
export function windowAt(camera: Camera, uv: Vec2, scale: number): Window | null {
  const xy = ideal(camera, ...uv);
  return xy && { x: xy[0], y: -xy[1], scale: scale * camera.f[0] };
}

/** Part of the distance by which the first view lies behind a photo's, so that the cameras show. */
const STEP_BACK = 0.6;
/** How far the first view is moved up and aside, so that the cameras do not hide the model. */
const RAISE_RAD = 0.16;
const ASIDE_RAD = 0.5;

/** From what a photo shows at `depth` along `forward` to a viewer somewhat behind the photographer. */
export function steppedBack(forward: THREE.Vector3, up: THREE.Vector3, depth: number): THREE.Vector3 {
  const right = forward.clone().cross(up).normalize();
  const away = forward.clone().multiplyScalar(-depth * (1 + STEP_BACK));
  return away.applyAxisAngle(right, -RAISE_RAD).applyAxisAngle(up, ASIDE_RAD);
}

/** Cosine of the angle to the vertical beyond which a view is as good as from above. */
const STEEP = 0.97;

/** The way to the viewer once another axis is up: as it was, but not along that axis. */
export function levelled(away: THREE.Vector3, before: THREE.Vector3, up: THREE.Vector3): THREE.Vector3 {
  const distance = away.length();
  if (Math.abs(away.dot(up)) <= STEEP * distance) return away.clone();
  const down = away.clone().addScaledVector(up, -0.7 * away.dot(up));
  return down.addScaledVector(before, 0.5 * distance).setLength(distance);
}

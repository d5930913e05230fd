// The photos' cameras as small pyramids with their pictures.

import * as THREE from "three";
import type { PhotoFacts } from "./api.ts";
import { imageUrl } from "./api.ts";
import type { Camera, Vec2 } from "./lens.ts";
import { ideal } from "./lens.ts";
import { loadTexture } from "./overlay.ts";

const CALM = 0x8f8f8f;
const WEAK = 0xe0b050;
const CHOSEN = 0xffffff;
const MAX_PICTURES = 150;
/** Distance of the picture from the camera's center, part of the scene's radius. */
const DEPTH = 0.09;

export class Frustums {
  readonly group = new THREE.Group();
  private readonly items = new Map<string, Frustum>();
  private key = "";

  /** One pyramid for each photo with a camera. */
  set(photos: PhotoFacts[], center: THREE.Vector3, radius: number, redraw: () => void): void {
    const key = JSON.stringify([photos.map(({ name, weak, camera }) => camera && [name, weak, camera]), center, radius]);
    if (key === this.key) return;
    this.key = key;
    for (const item of this.items.values()) item.dispose();
    this.items.clear();
    const cameras = photos.filter((photo) => photo.camera);
    for (const photo of cameras) {
      const item = new Frustum(photo, center, radius * DEPTH);
      this.items.set(photo.name, item);
      this.group.add(item.group);
      if (cameras.length <= MAX_PICTURES) void item.loadPicture().then(redraw, () => undefined);
    }
  }

  mark(chosen: string | null, hovered: string | null): void {
    for (const [name, item] of this.items) item.mark(name === chosen, name === hovered);
  }

  /** The photo under a ray, if any. */
  under(ray: THREE.Raycaster): string | null {
    if (!this.group.visible) return null;
    const planes = [...this.items.values()].map((item) => item.plane);
    return (ray.intersectObjects(planes, false)[0]?.object.userData.photo as string | undefined) ?? null;
  }
}

class Frustum {
  readonly group = new THREE.Group();
  readonly plane: THREE.Mesh<THREE.BufferGeometry, THREE.MeshBasicMaterial>;
  private readonly lines: THREE.LineSegments<THREE.BufferGeometry, THREE.LineBasicMaterial>;

  constructor(private readonly photo: PhotoFacts, center: THREE.Vector3, depth: number) {
    const camera = photo.camera!;
    const corners = cornersOf(camera, center, depth);
    this.lines = linesOf(corners, photo.weak ? WEAK : CALM);
    this.plane = planeOf(corners);
    this.plane.userData.photo = photo.name;
    this.group.add(this.lines, this.plane);
  }

  async loadPicture(): Promise<void> {
    const texture = await loadTexture(imageUrl(this.photo.name, 240));
    this.plane.material.map = texture;
    this.plane.material.opacity = 0.9;
    this.plane.material.color.set(0xffffff);
    this.plane.material.needsUpdate = true;
  }

  mark(chosen: boolean, hovered: boolean): void {
    const calm = this.photo.weak ? WEAK : CALM;
    this.lines.material.color.set(chosen || hovered ? CHOSEN : calm);
    this.lines.material.opacity = chosen || hovered ? 1 : 0.7;
    this.plane.material.opacity = hovered ? 1 : this.plane.material.map ? 0.9 : 0.25;
  }

  dispose(): void {
    this.group.removeFromParent();
    this.lines.geometry.dispose();
    this.plane.geometry.dispose();
    this.plane.material.map?.dispose();
  }
}

/** Both ends of each edge of a pyramid, as rows of `cornersOf`. */
export const EDGES = [0, 1, 0, 2, 0, 3, 0, 4, 1, 2, 2, 3, 3, 4, 4, 1];

/** Apex, then the picture's corners: left top, right top, right bottom, left bottom; scene frame. */
export function cornersOf(camera: Camera, center: THREE.Vector3, depth: number): THREE.Vector3[] {
  const { width, height } = camera;
  const pixels: Vec2[] = [[0, 0], [width, 0], [width, height], [0, height]];
  const local = pixels.map(([u, v]) => {
    const xy = ideal(camera, u, v) ?? plain(camera, u, v);
    return new THREE.Vector3(xy[0] * depth, xy[1] * depth, depth);
  });
  return [new THREE.Vector3(), ...local].map((p) => worldOf(camera, p).sub(center));
}

function plain(camera: Camera, u: number, v: number): Vec2 {
  return [(u - camera.c[0]) / camera.f[0], (v - camera.c[1]) / camera.f[1]];
}

function worldOf(camera: Camera, inCam: THREE.Vector3): THREE.Vector3 {
  const p = inCam.clone().sub(new THREE.Vector3(...camera.t));
  const [a, b, c] = camera.R.map((row) => new THREE.Vector3(...row));
  return new THREE.Vector3().addScaledVector(a, p.x).addScaledVector(b, p.y).addScaledVector(c, p.z);
}

function linesOf(p: THREE.Vector3[], color: number) {
  const geometry = new THREE.BufferGeometry().setFromPoints(EDGES.map((i) => p[i]));
  return new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color, transparent: true }));
}

function planeOf(p: THREE.Vector3[]) {
  const geometry = new THREE.BufferGeometry().setFromPoints(p.slice(1));
  geometry.setIndex([0, 2, 1, 0, 3, 2]);
  const uv = new Float32Array([0, 0, 1, 0, 1, 1, 0, 1]);
  geometry.setAttribute("uv", new THREE.BufferAttribute(uv, 2));
  const material = new THREE.MeshBasicMaterial({
    color: 0x555555, side: THREE.DoubleSide, transparent: true, opacity: 0.25, depthWrite: false, toneMapped: false,
  });
  return new THREE.Mesh(geometry, material);
}

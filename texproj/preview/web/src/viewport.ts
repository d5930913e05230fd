// The view of the model: orbiting freely, or through a photo's camera.

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { Frustums } from "./frustums.ts";
import type { Camera, Sides, Vec2, Vec3 } from "./lens.ts";
import { sidesOfPhoto } from "./lens.ts";
import { PhotoOverlay } from "./overlay.ts";
import { COARSE, FINE, PLAIN, Quality, SETTLE_MS } from "./quality.ts";
import type { Layer } from "./surface.ts";
import { Surface } from "./surface.ts";
import type { Pose, Window } from "./view.ts";
import {
  clamp, levelled, mixSides, pointOf, poseOfCamera, sidesOfAngle, sidesOfWindow, steppedBack, tangentsAt,
} from "./view.ts";

const FIELD_OF_VIEW_DEG = 36;
const FLIGHT_MS = 650;
const MAX_ZOOM = 64;

export class Viewport {
  readonly surface = new Surface();
  readonly frustums = new Frustums();
  readonly overlay = new PhotoOverlay();
  readonly camera = new THREE.PerspectiveCamera(FIELD_OF_VIEW_DEG);
  photoCamera: Camera | null = null;
  window: Window = { x: 0, y: 0, scale: 1 };
  /** After each frame: marks follow here. */
  onFrame: () => void = () => undefined;
  /** After the photo's window moved by hand. */
  onWindow: () => void = () => undefined;
  /** After the canvas changed its size. */
  onResize: () => void = () => undefined;
  frames = 0;
  /** The layer that the left part of the view shows, up to `wipe` of its width. */
  beside: Layer | null = null;
  wipe = 0.5;
  readonly renderer: THREE.WebGLRenderer;
  readonly scene = new THREE.Scene();
  /** What others draw beside the surface. */
  readonly marks = new THREE.Group();
  private controls: OrbitControls;
  sides: Sides = { left: -1, right: 1, bottom: -1, top: 1 };
  private flight: { from: Pose; to: Pose; start: number; ms: number; done: () => void } | null = null;
  private dirty = true;
  private movedAt = -Infinity;
  private readonly wanted = new Quality();
  private quality = PLAIN;
  private reach = 4;

  constructor(readonly canvas: HTMLCanvasElement) {
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: false });
    this.renderer.setClearColor(0x2b2b2b);
    this.renderer.toneMapping = THREE.NoToneMapping;
    this.scene.add(this.surface.group, this.frustums.group, this.marks, this.overlay.mesh);
    this.controls = this.newControls();
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement!);
    this.resize();
    requestAnimationFrame((now) => this.tick(now));
  }

  get flying(): boolean {
    return this.flight !== null;
  }

  /** Whether it moves, or did a moment ago. */
  get moving(): boolean {
    return performance.now() - this.movedAt < SETTLE_MS || this.dirty;
  }

  get size(): Vec2 {
    return [this.canvas.clientWidth, this.canvas.clientHeight];
  }

  /** Call `act` once the next frame is drawn. */
  onFirstFrame(act: () => void): void {
    this.waiting = act;
    this.dirty = true;
  }

  private waiting: (() => void) | null = null;

  invalidate(): void {
    this.dirty = true;
  }

  /** Which way is up (scene axes), and how far out the cameras are. */
  setUp(up: THREE.Vector3, reach: number): void {
    this.reach = Math.max(4, (reach / this.surface.radius) * 2 + 1);
    this.orbitAbout(up);
  }

  /** Another way up, seen from the same side: what was level stays in the picture. */
  turnUp(up: THREE.Vector3): void {
    if (this.photoCamera) this.leavePhoto();
    const target = this.controls.target.clone();
    const away = levelled(this.camera.position.clone().sub(target), this.camera.up, up);
    this.orbitAbout(up);
    this.controls.target.copy(target);
    this.camera.position.copy(target).add(away);
    this.controls.update();
    this.moved();
  }

  /** Turn the picture by an angle, radians; what is up from now on lies in the picture's plane. */
  roll(angle: number): void {
    const forward = new THREE.Vector3(0, 0, -1).applyQuaternion(this.camera.quaternion);
    const up = new THREE.Vector3(0, 1, 0).applyQuaternion(this.camera.quaternion);
    this.turnUp(up.applyAxisAngle(forward, angle).normalize());
  }

  /** Look from somewhat behind `eye` along `forward`, as a photographer stepping back. */
  lookAlong(eye: THREE.Vector3, forward: THREE.Vector3): void {
    this.leavePhoto();
    const depth = Math.max(-eye.dot(forward), this.surface.radius * 0.3);
    this.controls.target.copy(eye).addScaledVector(forward, depth);
    this.camera.position.copy(this.controls.target).add(steppedBack(forward, this.camera.up, depth));
    this.controls.update();
    this.moved();
  }

  /** See all that is within `radius` of the middle, the model at least, from direction `from`. */
  lookFrom(from: THREE.Vector3, radius = 0): void {
    this.leavePhoto();
    const half = Math.tan((FIELD_OF_VIEW_DEG * Math.PI) / 360);
    const distance = (Math.max(radius, this.surface.radius) / half) * 0.82;
    this.camera.position.copy(from).normalize().multiplyScalar(distance);
    this.controls.target.set(0, 0, 0);
    this.controls.update();
    this.moved();
  }

  /** Fly to where the model is seen whole, and what lies within `radius`, from the present side. */
  frame(radius = 0): void {
    const away = this.camera.position.clone().sub(this.controls.target);
    const from = this.pose();
    this.lookFrom(away.lengthSq() > 0 ? away : new THREE.Vector3(0, 0, 1), radius);
    this.fly(from, this.orbitPose(), () => undefined);
  }

  /** Fly into the exact view of a photo. */
  enterPhoto(camera: Camera, animate = true): void {
    const from = this.pose();
    this.photoCamera = camera;
    this.controls.enabled = false;
    this.overlay.setCamera(camera);
    this.fitPhoto();
    this.fly(from, this.photoPose(camera), () => this.overlay.show(true), animate ? FLIGHT_MS : 0);
  }

  /** Back to free orbiting, from where the photo was taken. */
  exitPhoto(): void {
    if (!this.photoCamera) return;
    const from = this.pose();
    const forward = new THREE.Vector3(0, 0, -1).applyQuaternion(this.camera.quaternion);
    const depth = Math.max(-this.camera.position.dot(forward), this.surface.radius * 0.05);
    this.leavePhoto();
    this.controls.target.copy(this.camera.position).addScaledVector(forward, depth);
    this.controls.update();
    this.fly(from, this.orbitPose(), () => undefined);
  }

  /** Orbit around a point of the scene (relative to the surface's center). */
  turnAbout(point: THREE.Vector3): void {
    const from = this.pose();
    this.controls.target.copy(point);
    this.controls.update();
    this.fly(from, this.orbitPose(), () => undefined);
  }

  /** Bring a world point into the middle of the view. */
  showPoint(world: Vec3): void {
    if (!this.photoCamera) {
      this.turnAbout(new THREE.Vector3(...world).sub(this.surface.center));
      return;
    }
    const at = this.toScreen(world);
    if (at) this.panPhoto(this.size[0] / 2 - at[0], this.size[1] / 2 - at[1]);
  }

  /** Show the whole photo. */
  fitPhoto(): void {
    const sides = sidesOfPhoto(this.photoCamera!);
    const [w, h] = this.size;
    const scale = Math.min(w / (sides.right - sides.left), h / (sides.top - sides.bottom));
    this.window = { x: (sides.left + sides.right) / 2, y: (sides.top + sides.bottom) / 2, scale };
  }

  setWindow(window: Window): void {
    this.window = window;
    this.moved();
  }

  /** Zoom of the photo's view by `factor` about a point of the canvas. */
  zoomPhoto(factor: number, at: Vec2): void {
    const camera = this.photoCamera!;
    const [w, h] = this.size;
    const whole = Math.min(w / (camera.width / camera.f[0]), h / (camera.height / camera.f[1]));
    const scale = clamp(this.window.scale * factor, whole / 4, MAX_ZOOM * camera.f[0]);
    const [dx, dy] = [at[0] - w / 2, h / 2 - at[1]];
    const x = this.window.x + dx / this.window.scale - dx / scale;
    const y = this.window.y + dy / this.window.scale - dy / scale;
    this.setWindow({ x, y, scale });
    this.onWindow();
  }

  /** Zoom by `factor` about a point of the canvas, whatever the view. */
  zoomAt(factor: number, at: Vec2): void {
    if (this.photoCamera) {
      this.zoomPhoto(factor, at);
      return;
    }
    const offset = this.camera.position.clone().sub(this.controls.target).divideScalar(factor);
    this.camera.position.copy(this.controls.target).add(offset);
    this.moved();
  }

  panPhoto(dx: number, dy: number): void {
    const { x, y, scale } = this.window;
    this.setWindow({ x: x - dx / scale, y: y + dy / scale, scale });
    this.onWindow();
  }

  /** World point to canvas pixels; null behind the viewer. */
  toScreen(world: Vec3): Vec2 | null {
    const p = new THREE.Vector3(...world).sub(this.surface.center);
    p.applyMatrix4(this.camera.matrixWorldInverse);
    if (p.z >= 0) return null;
    return pointOf([-p.x / p.z, -p.y / p.z], this.sides, this.size);
  }

  /** The ray through a point of the canvas: origin and unit direction, world. */
  ray(at: Vec2): { origin: Vec3; direction: Vec3 } {
    const ray = this.raycaster(at).ray;
    return {
      origin: ray.origin.clone().add(this.surface.center).toArray() as Vec3,
      direction: ray.direction.toArray() as Vec3,
    };
  }

  /** The photo whose pyramid is under a point of the canvas. */
  photoUnder(at: Vec2): string | null {
    return this.photoCamera ? null : this.frustums.under(this.raycaster(at));
  }

  /** Whether a surface normal there looks at the viewer. */
  facing(world: Vec3, normal: Vec3): boolean {
    const toEye = this.camera.position.clone().add(this.surface.center).sub(new THREE.Vector3(...world));
    return toEye.dot(new THREE.Vector3(...normal)) > 0;
  }

  /** The view as it is now, as a PNG in a data: address. */
  picture(): string {
    this.setQuality(FINE);
    if (!this.flight) this.sides = this.currentSides();
    this.draw(this.sides);
    return this.canvas.toDataURL("image/png");
  }

  private raycaster(at: Vec2): THREE.Raycaster {
    const [x, y] = tangentsAt(at, this.sides, this.size);
    const direction = new THREE.Vector3(x, y, -1).normalize().applyQuaternion(this.camera.quaternion);
    const caster = new THREE.Raycaster(this.camera.position.clone(), direction);
    caster.camera = this.camera;
    return caster;
  }

  private orbitAbout(up: THREE.Vector3): void {
    this.camera.up.copy(up);
    this.controls.dispose();
    this.controls = this.newControls();
  }

  private newControls(): OrbitControls {
    const controls = new OrbitControls(this.camera, this.canvas);
    controls.enableDamping = true;
    controls.dampingFactor = 0.12;
    controls.zoomToCursor = true;
    controls.rotateSpeed = 0.9;
    controls.addEventListener("change", () => this.moved());
    return controls;
  }

  private moved(): void {
    this.movedAt = performance.now();
    this.dirty = true;
  }

  private leavePhoto(): void {
    this.photoCamera = null;
    this.overlay.show(false);
    this.controls.enabled = true;
  }

  private resize(): void {
    const box = this.canvas.parentElement!;
    const [w, h] = [Math.max(box.clientWidth, 1), Math.max(box.clientHeight, 1)];
    const before = this.size;
    this.renderer.setSize(w, h);
    this.camera.aspect = w / h;
    if (this.photoCamera && before[0] > 0) this.window.scale *= Math.min(w / before[0], h / before[1]) || 1;
    this.onResize();
    this.draw(this.currentSides());
    this.dirty = true;
  }

  private currentSides(): Sides {
    if (this.photoCamera) return sidesOfWindow(this.window, this.size);
    return sidesOfAngle(FIELD_OF_VIEW_DEG, this.camera.aspect);
  }

  private pose(): Pose {
    return { position: this.camera.position.clone(), quaternion: this.camera.quaternion.clone(), sides: { ...this.sides } };
  }

  private orbitPose(): Pose {
    return { position: this.camera.position.clone(), quaternion: this.camera.quaternion.clone(), sides: this.currentSides() };
  }

  private photoPose(camera: Camera): Pose {
    return poseOfCamera(camera, this.surface.center, this.currentSides());
  }

  private fly(from: Pose, to: Pose, done: () => void, ms = FLIGHT_MS): void {
    const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.overlay.show(false);
    this.flight = { from, to, start: performance.now(), ms: still ? 0 : ms, done };
    this.controls.enabled = false;
    this.moved();
  }

  private advanceFlight(now: number): void {
    const { from, to, start, ms, done } = this.flight!;
    const part = ms > 0 ? clamp((now - start) / ms, 0, 1) : 1;
    const eased = part * part * (3 - 2 * part);
    this.camera.position.lerpVectors(from.position, to.position, eased);
    this.camera.quaternion.slerpQuaternions(from.quaternion, to.quaternion, eased);
    this.sides = mixSides(from.sides, to.sides, eased);
    this.moved();
    if (part < 1) return;
    this.flight = null;
    this.controls.enabled = !this.photoCamera;
    done();
  }

  private tick(now: number): void {
    requestAnimationFrame((next) => this.tick(next));
    if (this.flight) this.advanceFlight(now);
    else {
      if (this.controls.enabled) this.controls.update();
      this.sides = this.currentSides();
    }
    this.setQuality(this.wanted.at(now, this.movedAt));
    if (!this.dirty) return;
    this.dirty = false;
    this.frames++;
    this.draw(this.sides);
    this.onFrame();
    this.waiting?.();
    this.waiting = null;
  }

  /** Coarse while a slow machine moves, plain when it stops, fine a moment later. */
  private setQuality(quality: number): void {
    if (quality === this.quality) return;
    this.quality = quality;
    this.surface.setMoving(quality === COARSE);
    this.renderer.setPixelRatio(quality * Math.min(Math.max(devicePixelRatio, 1), 2));
    this.dirty = true;
  }

  draw(sides: Sides): void {
    const distance = this.camera.position.length();
    const far = distance + this.surface.radius * this.reach;
    const near = Math.max(distance - this.surface.radius * this.reach, far * 5e-4);
    const { left, right, bottom, top } = sides;
    this.camera.projectionMatrix.makePerspective(
      left * near, right * near, top * near, bottom * near, near, far, this.camera.coordinateSystem,
    );
    this.camera.projectionMatrixInverse.copy(this.camera.projectionMatrix).invert();
    this.overlay.setSides(sides);
    if (this.beside && this.surface.layer === "relit" && !this.photoCamera) this.drawBoth(this.beside);
    else this.renderer.render(this.scene, this.camera);
  }

  /** The left part of the view in another layer. */
  private drawBoth(left: Layer): void {
    const [w, h] = this.size;
    const x = w * this.wipe;
    const own = this.surface.layer;
    this.renderer.setScissorTest(true);
    for (const [layer, from, width] of [[left, 0, x], [own, x, w - x]] as const) {
      this.surface.setLayer(layer);
      this.renderer.setScissor(from, 0, width, h);
      if (width > 0) this.renderer.render(this.scene, this.camera);
    }
    this.renderer.setScissorTest(false);
  }
}

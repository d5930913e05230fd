// Pictures of the model beside the view itself.

import * as THREE from "three";
import type { Camera, Vec2 } from "./lens.ts";
import { sidesOfPhoto } from "./lens.ts";
import { poseOfCamera } from "./view.ts";
import type { Viewport } from "./viewport.ts";

/** Draw the view once more into a square of `target`, magnified around a point: the loupe. */
export function drawLoupe(viewport: Viewport, target: CanvasRenderingContext2D, at: Vec2, zoom: number): void {
  const { renderer, canvas, sides } = viewport;
  const edge = target.canvas.width;
  const [w, h] = viewport.size;
  const { left, right, bottom, top } = sides;
  const [tx, ty] = [(right - left) / w, (top - bottom) / h];
  const x = left + at[0] * tx;
  const y = top - at[1] * ty;
  const half = edge / 2 / zoom / devicePixelRatio;
  const ratio = renderer.getPixelRatio();
  const px = edge / ratio;
  renderer.setViewport(0, 0, px, px);
  viewport.draw({ left: x - half * tx, right: x + half * tx, bottom: y - half * ty, top: y + half * ty });
  target.drawImage(canvas, 0, canvas.height - edge, edge, edge, 0, 0, edge, edge);
  renderer.setViewport(0, 0, w, h);
  viewport.draw(sides);
}

/** Draw the bare model into `target` as `camera` would show it. */
export function through(viewport: Viewport, camera: Camera, target: HTMLCanvasElement): void {
  const { renderer, surface, scene } = viewport;
  const { width, height } = target;
  const eye = viewport.camera.clone();
  const hidden = scene.children.filter((child) => child !== surface.group && child.visible);
  const layer = surface.layer;
  const image = new THREE.WebGLRenderTarget(width, height, { samples: 4 });
  const pose = poseOfCamera(camera, surface.center, sidesOfPhoto(camera));
  for (const child of hidden) child.visible = false;
  surface.setLayer("shaded");
  viewport.camera.position.copy(pose.position);
  viewport.camera.quaternion.copy(pose.quaternion);
  renderer.setRenderTarget(image);
  viewport.draw(pose.sides);
  const pixels = new Uint8Array(4 * width * height);
  renderer.readRenderTargetPixels(image, 0, 0, width, height, pixels);
  renderer.setRenderTarget(null);
  image.dispose();
  surface.setLayer(layer);
  for (const child of hidden) child.visible = true;
  viewport.camera.copy(eye);
  viewport.invalidate();
  put(pixels, target);
}

/** Pixels as the graphics card has them, the lowest row first. */
function put(pixels: Uint8Array, target: HTMLCanvasElement): void {
  const { width, height } = target;
  const picture = new ImageData(width, height);
  const row = 4 * width;
  for (let y = 0; y < height; y++) picture.data.set(pixels.subarray(row * y, row * (y + 1)), row * (height - 1 - y));
  target.getContext("2d")!.putImageData(picture, 0, 0);
}

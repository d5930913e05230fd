// The photo on a plain canvas: pan, zoom, and a loupe.

import { imageUrl } from "./api.ts";
import { byId } from "./dom.ts";
import type { Vec2 } from "./lens.ts";

const MAX_SCALE = 60;
const LAYER_ALPHA = 0.55;
/** Screen pixels per photo pixel from which single pixels are shown as squares. */
const SQUARES_FROM = 4;

export class PhotoPane {
  readonly pane = byId("photo-pane");
  readonly canvas = byId<HTMLCanvasElement>("photo-canvas");
  scale = 1;
  /** Photo pixel in the middle of the pane. */
  middle: Vec2 = [0, 0];
  onMove: () => void = () => undefined;
  /** Called after the photo was drawn. */
  readonly drawn: (() => void)[] = [];
  /** Drawn over the photo, half transparent: its mask. */
  layer: HTMLCanvasElement | null = null;
  private image: ImageBitmap | null = null;
  private photo = "";
  private photoSize: Vec2 = [1, 1];
  private queued = false;

  constructor() {
    new ResizeObserver(() => this.resize()).observe(this.pane);
  }

  get size(): Vec2 {
    return [this.pane.clientWidth, this.pane.clientHeight];
  }

  /** Show a photo of full size `width` x `height`, first small, then sharp. */
  async load(photo: string, width: number, height: number): Promise<void> {
    const anew = this.photo !== photo;
    this.photo = photo;
    this.photoSize = [width, height];
    if (!anew) return;
    this.image = null;
    this.fit();
    for (const size of [1600, 8192] as const) {
      const answer = await fetch(imageUrl(photo, size)).catch(() => null);
      if (this.photo !== photo || !answer?.ok) return;
      this.image = await createImageBitmap(await answer.blob());
      this.redraw();
    }
    this.pane.dataset.sharp = photo;
  }

  fit(): void {
    const [w, h] = this.size;
    const [pw, ph] = this.photoSize;
    this.scale = Math.max(Math.min(w / pw, h / ph), 1e-3);
    this.middle = [pw / 2, ph / 2];
    this.moved();
  }

  pan(dx: number, dy: number): void {
    this.middle = [this.middle[0] - dx / this.scale, this.middle[1] - dy / this.scale];
    this.moved();
  }

  /** Zoom by `factor`; the photo pixel at `at` stays there. */
  zoom(factor: number, at: Vec2): void {
    const fixed = this.toPhoto(at);
    const [pw, ph] = this.photoSize;
    const least = Math.min(this.size[0] / pw, this.size[1] / ph) / 2;
    this.scale = Math.min(Math.max(this.scale * factor, least), MAX_SCALE);
    const now = this.toPhoto(at);
    this.middle = [this.middle[0] + fixed[0] - now[0], this.middle[1] + fixed[1] - now[1]];
    this.moved();
  }

  /** Bring a photo pixel into the middle, at least so large. */
  show(uv: Vec2, scale: number): void {
    this.middle = uv;
    this.scale = Math.max(this.scale, scale);
    this.moved();
  }

  /** Go to a photo pixel and scale without telling anybody. */
  follow(middle: Vec2, scale: number): void {
    this.middle = middle;
    this.scale = scale;
    this.redraw();
  }

  toPhoto(at: Vec2): Vec2 {
    const [w, h] = this.size;
    return [this.middle[0] + (at[0] - w / 2) / this.scale, this.middle[1] + (at[1] - h / 2) / this.scale];
  }

  toScreen(uv: Vec2): Vec2 {
    const [w, h] = this.size;
    return [w / 2 + (uv[0] - this.middle[0]) * this.scale, h / 2 + (uv[1] - this.middle[1]) * this.scale];
  }

  contains(uv: Vec2): boolean {
    return uv[0] >= 0 && uv[1] >= 0 && uv[0] <= this.photoSize[0] && uv[1] <= this.photoSize[1];
  }

  redraw(): void {
    if (this.queued) return;
    this.queued = true;
    requestAnimationFrame(() => {
      this.queued = false;
      this.draw();
      for (const act of this.drawn) act();
    });
  }

  /** The surroundings of `at`, magnified. */
  drawLoupe(target: CanvasRenderingContext2D, at: Vec2, zoom: number): void {
    const edge = target.canvas.width;
    const scale = this.scale * zoom * devicePixelRatio;
    const [u, v] = this.toPhoto(at);
    target.setTransform(scale, 0, 0, scale, edge / 2 - u * scale, edge / 2 - v * scale);
    this.paint(target, this.scale * zoom);
    target.resetTransform();
  }

  private moved(): void {
    this.onMove();
    this.redraw();
  }

  private resize(): void {
    const [w, h] = this.size;
    this.canvas.width = Math.max(1, Math.round(w * devicePixelRatio));
    this.canvas.height = Math.max(1, Math.round(h * devicePixelRatio));
    this.draw();
    this.moved();
  }

  private draw(): void {
    const context = this.canvas.getContext("2d")!;
    context.resetTransform();
    context.fillStyle = "#2b2b2b";
    context.fillRect(0, 0, this.canvas.width, this.canvas.height);
    const k = devicePixelRatio * this.scale;
    const [x, y] = this.toScreen([0, 0]);
    context.setTransform(k, 0, 0, k, x * devicePixelRatio, y * devicePixelRatio);
    this.paint(context, this.scale);
  }

  private paint(context: CanvasRenderingContext2D, scale: number): void {
    if (!this.image) return;
    const sharp = this.image.width >= this.photoSize[0];
    context.imageSmoothingEnabled = !(sharp && scale >= SQUARES_FROM);
    context.imageSmoothingQuality = "high";
    context.drawImage(this.image, 0, 0, ...this.photoSize);
    if (!this.layer) return;
    context.globalAlpha = LAYER_ALPHA;
    context.drawImage(this.layer, 0, 0, ...this.photoSize);
    context.globalAlpha = 1;
  }
}

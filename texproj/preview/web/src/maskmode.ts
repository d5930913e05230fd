// Masks: what of a photo is never used is painted, erased, grown; each stroke is on disk at once.

import * as api from "./api.ts";
import { byId, svg } from "./dom.ts";
import type { Host } from "./host.ts";
import type { Vec2 } from "./lens.ts";
import type { PhotoPane } from "./photopane.ts";
import { at as placeOf } from "./pointer.ts";
import { clamp } from "./view.ts";

export type Tool = "paint" | "erase";

/** Longer side of the picture of the mask that is drawn over the photo. */
const SHOWN_PX = 1600;
const COLOR = "#ff3b30";
const STEP_PX = 20;

export class MaskMode {
  photo: api.PhotoFacts | null = null;
  tool: Tool = "paint";
  /** Half the brush's width, photo pixels. */
  radius = 40;
  /** By how much Grow and Shrink change the mask, photo pixels. */
  growth = 10;
  facts: api.MaskFacts | null = null;
  busy = false;
  /** Where the brush is, in the pane. */
  private brush: Vec2 | null = null;
  private stroke: Vec2[] | null = null;
  private readonly layer = document.createElement("canvas");
  private scale = 1;
  private queue: Promise<void> = Promise.resolve();

  constructor(private readonly app: Host, private readonly pane: PhotoPane) {
    const frame = byId("photo-pane");
    frame.addEventListener("pointerdown", (event) => this.press(event), { capture: true });
    frame.addEventListener("pointermove", (event) => this.drag(event), { capture: true });
    frame.addEventListener("pointerup", (event) => this.release(event), { capture: true });
    frame.addEventListener("pointerleave", () => this.moveBrush(null));
    pane.drawn.push(() => this.drawBrush());
  }

  get active(): boolean {
    return document.body.dataset.mode === "mask";
  }

  async enter(photo: api.PhotoFacts): Promise<void> {
    const [width, height] = [photo.width!, photo.height!];
    Object.assign(this, { photo, facts: null, stroke: null, brush: null });
    this.radius = Math.round(Math.max(width, height) / 60);
    this.scale = Math.min(1, SHOWN_PX / Math.max(width, height));
    this.layer.width = Math.max(1, Math.round(width * this.scale));
    this.layer.height = Math.max(1, Math.round(height * this.scale));
    byId("photo-pane").hidden = false;
    byId("photo-title").textContent = photo.name;
    this.pane.layer = this.layer;
    void this.pane.load(photo.name, width, height);
    this.pane.fit();
    byId("photo-pane").focus({ preventScroll: true });
    await this.reload();
  }

  leave(): void {
    document.body.dataset.mode = "view";
    this.pane.layer = null;
    this.photo = null;
    byId("photo-pane").hidden = true;
    byId("photo-marks").replaceChildren();
    this.app.show();
  }

  onFiles(changed: string[]): void {
    if (this.active && !this.busy && changed.some((path) => path.startsWith("masks"))) void this.reload();
  }

  choose(tool: Tool): void {
    this.tool = tool;
    this.app.show();
  }

  setRadius(radius: number): void {
    this.radius = radius;
    this.drawBrush();
  }

  grow(by: number): void {
    void this.send({ kind: "grow", radius: by });
  }

  clear(): void {
    void this.send({ kind: "clear" });
  }

  undo(): void {
    if (this.facts?.undo) void this.send({ kind: "undo" });
  }

  /** What a key does; false if nothing. */
  key(event: KeyboardEvent): boolean {
    if ((event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "z") this.undo();
    else if (event.ctrlKey || event.metaKey || event.altKey) return false;
    else if (event.key === "Escape") this.leave();
    else if (event.key === "x") this.choose(this.tool === "paint" ? "erase" : "paint");
    else if (event.key === "[" || event.key === "]") this.resize(event.key === "]" ? 1.25 : 0.8);
    else if (event.key === "f") this.pane.fit();
    else if ((event.target as HTMLElement).closest("aside, header, nav")) return false;
    else if (event.key in ARROWS) this.stepBrush(ARROWS[event.key], event.shiftKey ? 4 : 1);
    else if (event.key === "Enter") this.dot();
    else return false;
    return true;
  }

  private resize(factor: number): void {
    this.setRadius(clamp(Math.round(this.radius * factor), 1, 5000));
    this.app.show();
  }

  private stepBrush([dx, dy]: Vec2, times: number): void {
    const [w, h] = this.pane.size;
    const [x, y] = this.brush ?? [w / 2, h / 2];
    this.moveBrush([clamp(x + dx * STEP_PX * times, 0, w), clamp(y + dy * STEP_PX * times, 0, h)]);
  }

  /** A stroke of one point, where the brush is. */
  private dot(): void {
    if (!this.brush) this.stepBrush([0, 0], 1);
    this.stroke = [this.pane.toPhoto(this.brush!)];
    this.drawStroke();
    this.end();
  }

  private press(event: PointerEvent): void {
    if (!this.active || event.button !== 0 || !event.isPrimary || event.altKey) return;
    event.stopPropagation();
    event.preventDefault();
    const frame = event.currentTarget as HTMLElement;
    frame.focus({ preventScroll: true });
    frame.setPointerCapture(event.pointerId);
    this.brush = placeOf(event, this.pane.canvas);
    this.stroke = [this.pane.toPhoto(this.brush)];
    this.drawStroke();
  }

  private drag(event: PointerEvent): void {
    if (!this.active) return;
    this.moveBrush(placeOf(event, this.pane.canvas));
    if (!this.stroke) return;
    event.stopPropagation();
    this.stroke.push(this.pane.toPhoto(this.brush!));
    this.drawStroke();
  }

  private release(event: PointerEvent): void {
    if (!this.stroke) return;
    event.stopPropagation();
    this.end();
  }

  private end(): void {
    const points = this.stroke!;
    this.stroke = null;
    void this.send({ kind: this.tool, radius: this.radius, points });
  }

  /** Each after the one before it, since each has the version of the mask that it changes. */
  private send(stroke: Omit<api.Stroke, "base">): Promise<void> {
    this.queue = this.queue.then(() => this.sendNow(stroke));
    return this.queue;
  }

  private async sendNow(stroke: Omit<api.Stroke, "base">): Promise<void> {
    const photo = this.photo;
    if (!photo || !this.facts) return;
    this.busy = true;
    try {
      this.facts = await api.drawMask(photo.name, { ...stroke, base: this.facts.version });
    } catch (error) {
      this.app.complain(error);
    }
    if (this.photo === photo) await this.reload();
    this.busy = false;
    this.app.show();
  }

  /** Take over the mask as it is on disk. */
  private async reload(): Promise<void> {
    const photo = this.photo!;
    try {
      const facts = await api.mask(photo.name);
      const picture = await api.maskPicture(photo.name);
      if (this.photo !== photo) return;
      this.facts = facts;
      this.paintAll(picture);
    } catch (error) {
      this.app.complain(error);
    }
    this.pane.redraw();
    this.app.show();
  }

  private paintAll(picture: ImageBitmap | null): void {
    const context = this.layer.getContext("2d", { willReadFrequently: true })!;
    const { width, height } = this.layer;
    context.globalCompositeOperation = "source-over";
    context.clearRect(0, 0, width, height);
    if (!picture) return;
    context.drawImage(picture, 0, 0, width, height);
    const data = context.getImageData(0, 0, width, height);
    const [r, g, b] = [0xff, 0x3b, 0x30];
    for (let i = 0; i < data.data.length; i += 4) data.data.set([r, g, b, data.data[i] === 0 ? 255 : 0], i);
    context.putImageData(data, 0, 0);
  }

  /** The last part of the stroke, until the server answers. */
  private drawStroke(): void {
    const context = this.layer.getContext("2d")!;
    context.globalCompositeOperation = this.tool === "paint" ? "source-over" : "destination-out";
    context.strokeStyle = COLOR;
    context.lineWidth = 2 * this.radius * this.scale;
    context.lineCap = context.lineJoin = "round";
    context.beginPath();
    const [from, to] = [this.stroke!.at(-2) ?? this.stroke![0], this.stroke!.at(-1)!];
    context.moveTo(from[0] * this.scale, from[1] * this.scale);
    context.lineTo(to[0] * this.scale, to[1] * this.scale + 0.01);
    context.stroke();
    this.pane.redraw();
  }

  private moveBrush(to: Vec2 | null): void {
    if (!this.active) return;
    this.brush = to;
    this.drawBrush();
  }

  private drawBrush(): void {
    if (!this.active) return;
    const marks = byId("photo-marks");
    if (!this.brush) {
      marks.replaceChildren();
      return;
    }
    const ring = { cx: this.brush[0], cy: this.brush[1], r: Math.max(this.radius * this.pane.scale, 1) };
    marks.replaceChildren(svg("circle", { class: "brush-halo", ...ring }), svg("circle", { class: "brush", ...ring }));
  }
}

const ARROWS: Record<string, Vec2> = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

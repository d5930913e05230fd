// What picking needs of the page that it is a part of.

import type { Facts, Hit, PhotoFacts } from "./api.ts";
import type { Camera, Vec2 } from "./lens.ts";
import type { Look } from "./panel.ts";
import type { Viewport } from "./viewport.ts";

export interface Host {
  readonly viewport: Viewport;
  readonly look: Look;
  /** What the server knew last; null before it answered. */
  readonly facts: Facts | null;
  /** The chosen photo as the server knows it now. */
  readonly photo: PhotoFacts | null;
  /** Change what is shown. */
  change(part: Partial<Look>): void;
  applyLook(): void;
  /** Draw lists and panels anew. */
  show(): void;
  refresh(): Promise<void>;
  /** All photos that take part. */
  readonly photos: PhotoFacts[];
  /** Photos that can be read and have no camera yet. */
  readonly unregistered: number;
  /** Start work on the whole project. */
  start(kind: string, more?: { place?: number | null }): Promise<void>;
  /** See the model as a photo would show it from another camera, half of the photo over it. */
  lookThrough(photo: string, camera: Camera): void;
  /** Say what the server refused. */
  complain(error: unknown): void;
  /** The model point under a point of the canvas. */
  hit(at: Vec2): Promise<Hit | null>;
  loadOverlay(photo: string): Promise<void>;
}

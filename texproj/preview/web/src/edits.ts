// What the page changes in the project beside picks and masks.

import * as api from "./api.ts";
import type { Host } from "./host.ts";

export class Edits {
  private seenIn: Record<string, string[]> = {};

  constructor(private readonly app: Host) {}

  /** Leave a photo out of everything, or take it back. */
  async leaveOut(photo: api.PhotoFacts, out: boolean): Promise<void> {
    await api.leaveOut(photo.name, out).catch((error: unknown) => this.app.complain(error));
    await this.app.refresh();
  }

  /** Make vertices, a texture or patches from now on. */
  async makeTo(to: string): Promise<void> {
    try {
      const { version } = await api.settings();
      await api.changeSettings(version, [{ table: "color", key: "to", value: to }]);
    } catch (error) {
      this.app.complain(error);
    }
    await this.app.refresh();
  }

  /** Remember in the project which way the model stands on this page. */
  async rememberUp(axis: string): Promise<void> {
    await api.rememberUp(axis).catch((error: unknown) => this.app.complain(error));
  }

  /** The photos that show the same as one, as far as it is known. */
  seenAlso(name: string | null): string[] {
    return this.seenIn[name ?? ""] ?? [];
  }

  /** Find out which photos show the same as one; draws again where there are some. */
  async findSeenAlso(photo: api.PhotoFacts): Promise<void> {
    if (photo.name in this.seenIn || !photo.width) return;
    const found = await api.partners(photo.name).catch(() => ({ photos: [] }));
    this.seenIn[photo.name] = found.photos;
    if (found.photos.length && this.app.photo?.name === photo.name) this.app.show();
  }

  /** The photos may show other things in common than was found before. */
  forget(): void {
    this.seenIn = {};
  }
}

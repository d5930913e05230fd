// The camera that the picks give while one picks, and the points of other photos that it shows.

import * as api from "./api.ts";
import type { Camera } from "./lens.ts";

export const FIT_FROM = 4;
const FIT_PAUSE_MS = 120;
/** How far off a camera is taken to be that does not tell it. */
const UNKNOWN_ERROR_PX = 20;

/** Follows the picks of one photo. */
export class PickFit {
  found: api.Fit | null = null;
  problem = "";
  /** Whether it is older than the picks. */
  busy = false;
  /** Picks that are left out of it, to see the fit without them. */
  readonly off = new Set<string>();
  /** Points picked in other photos, where they should lie in this one. */
  proposals: api.Proposal[] = [];
  private timer = 0;
  private number = 0;
  private proposed = "";

  /** told: called when there is something new to draw. */
  constructor(private readonly told: () => void) {}

  reset(): void {
    Object.assign(this, { found: null, problem: "", proposals: [], proposed: "" });
    this.off.clear();
  }

  /** The camera, if it is good enough to say where other points lie. */
  get camera(): Camera | null {
    return this.found && (this.found.accepted || this.found.rough) ? this.found.camera : null;
  }

  /** Soon, seek the camera of these pairs; `known` stands in for it where there is none. */
  seek(photo: string, list: api.SavedPick[], known: Camera | null): void {
    this.busy = true;
    clearTimeout(this.timer);
    this.timer = window.setTimeout(() => void this.seekNow(photo, list, known), FIT_PAUSE_MS);
  }

  residual(name: string): number | null {
    const index = this.index(name);
    return index < 0 ? null : this.found!.residual_px[index];
  }

  /** Whether a pick that counts does not fit the others. */
  outlier(name: string): boolean {
    const index = this.index(name);
    return index >= 0 && this.found!.used[index] && !this.found!.inliers[index];
  }

  index(name: string): number {
    return this.found ? this.found.names.indexOf(name) : -1;
  }

  private async seekNow(photo: string, list: api.SavedPick[], known: Camera | null): Promise<void> {
    const number = ++this.number;
    const without = list.map((pick) => pick.name).filter((name) => this.off.has(name));
    let found: api.Fit | null = null;
    let problem = "";
    if (list.length - without.length >= FIT_FROM) {
      try {
        found = await api.fit(photo, list, without);
      } catch (error) {
        problem = error instanceof api.Refusal ? error.message : "The server does not answer.";
      }
    }
    if (number !== this.number) return;
    Object.assign(this, { busy: false, found, problem });
    this.told();
    await this.propose(photo, list, this.camera ?? known, number);
  }

  /** Ask anew for points of other photos once the picks are others. */
  private async propose(photo: string, list: api.SavedPick[], camera: Camera | null, number: number): Promise<void> {
    const key = JSON.stringify([photo, list, camera]);
    if (key === this.proposed) return;
    this.proposed = key;
    const wanted = camera && list.length >= FIT_FROM;
    const found = wanted ? await api.proposals(photo, camera, this.found?.expected_error_px ?? UNKNOWN_ERROR_PX, list).catch(() => []) : [];
    if (number !== this.number) return;
    this.proposals = found;
    this.told();
  }
}

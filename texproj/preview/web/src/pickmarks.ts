// Where picks, residuals and proposed points are drawn over the photo and over the model.

import type * as api from "./api.ts";
import { byId } from "./dom.ts";
import type { Vec2, Vec3 } from "./lens.ts";
import type { Mark } from "./marks.ts";
import { drawMarks, magnification, markUnder } from "./marks.ts";
import type { PhotoPane } from "./photopane.ts";
import type { PickFit } from "./pickfit.ts";
import type { Pick, Picks } from "./picks.ts";
import { isPair } from "./picks.ts";
import type { Viewport } from "./viewport.ts";

export type Side = "photo" | "model";

/** What is drawn of picking. */
export interface Drawn {
  readonly active: boolean;
  readonly app: { readonly viewport: Viewport };
  readonly pane: PhotoPane;
  readonly live: PickFit;
  readonly picks: Picks;
  readonly photo: api.PhotoFacts | null;
  readonly fit: api.Fit | null;
  readonly guess: api.Prediction | null;
  readonly proposal: api.Proposal | null;
  readonly selected: string | null;
  readonly selectedPick: Pick | null;
  readonly cursors: Record<Side, Vec2 | null>;
}

export class PickMarks {
  constructor(private readonly mode: Drawn) {}

  of(side: Side): Mark[] {
    const factor = magnification(this.mode.fit, this.mode.pane.scale);
    const made = this.mode.picks.map((pick) => this.markOf(pick, side, factor));
    const proposed = this.mode.selectedPick ? [] : this.mode.live.proposals.map((proposal) => this.proposalMark(proposal, side));
    return [...proposed, ...made, this.guessMark(side)].filter((mark) => mark !== null);
  }

  under(side: Side, at: Vec2): Mark | null {
    return markUnder(this.of(side), at);
  }

  private markOf(pick: Pick, side: Side, factor: number): Mark | null {
    const at = this.screenOf(side, pick.uv, pick.xyz);
    if (!at) return null;
    const { live } = this.mode;
    const index = isPair(pick) ? live.index(pick.name) : -1;
    const residual = index >= 0 ? live.residual(pick.name) : null;
    const outlier = index >= 0 && live.outlier(pick.name);
    return {
      pick, at, outlier, guess: false,
      selected: pick.name === this.mode.selected,
      unused: live.off.has(pick.name),
      away: side === "model" && !!pick.normal && !this.mode.app.viewport.facing(pick.xyz!, pick.normal),
      tip: side === "photo" && index >= 0 ? this.tip(pick.uv!, index, factor) : undefined,
      amount: residual !== null && (outlier || pick.name === this.mode.selected) ? `${residual.toFixed(1)} px` : undefined,
    };
  }

  private proposalMark(proposal: api.Proposal, side: Side): Mark | null {
    const { name, uv, xyz, normal } = proposal;
    const at = this.screenOf(side, uv, xyz);
    if (!at) return null;
    const pick = { name, uv, xyz, normal };
    return { pick, at, outlier: false, unused: false, selected: proposal === this.mode.proposal, away: false, guess: true };
  }

  private guessMark(side: Side): Mark | null {
    const pick = this.mode.selectedPick;
    if (!this.mode.guess || !pick || (side === "photo" ? pick.uv : pick.xyz)) return null;
    const at = this.screenOf(side, this.mode.guess.uv, this.mode.guess.xyz);
    return at && { pick, at, outlier: false, unused: false, selected: true, away: false, guess: true };
  }

  private screenOf(side: Side, uv: Vec2 | null, xyz: Vec3 | null): Vec2 | null {
    if (side === "photo") return uv && this.mode.pane.toScreen(uv);
    return xyz && this.mode.app.viewport.toScreen(xyz);
  }

  private tip(uv: Vec2, index: number, factor: number): Vec2 | undefined {
    const [u, v] = this.mode.fit!.projected[index];
    if (u === null || v === null) return undefined;
    const grown = this.mode.fit!.inliers[index] ? factor : 1;
    return this.mode.pane.toScreen([uv[0] + (u - uv[0]) * grown, uv[1] + (v - uv[1]) * grown]);
  }

  drawPhoto(): void {
    if (!this.mode.active || !this.mode.photo) return;
    const factor = magnification(this.mode.fit, this.mode.pane.scale);
    const enlarged = this.mode.fit && factor > 1 ? ` \u00b7 residuals drawn ${factor} \u00d7` : "";
    byId("photo-title").textContent = this.mode.photo.name + enlarged;
    drawMarks(byId("photo-marks"), this.of("photo"), this.mode.cursors.photo);
  }

  drawModel(): void {
    if (this.mode.active) drawMarks(byId("model-marks"), this.of("model"), this.mode.cursors.model);
  }
}

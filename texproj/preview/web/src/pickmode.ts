// Picking: photo on the left, model on the right, pairs of points between them.

import * as api from "./api.ts";
import { byId } from "./dom.ts";
import type { Host } from "./host.ts";
import type { Camera, Vec2, Vec3 } from "./lens.ts";
import { project } from "./lens.ts";
import type { Mark } from "./marks.ts";
import { drawMarks, magnification, markUnder } from "./marks.ts";
import { PhotoPane } from "./photopane.ts";
import type { Pick, Picks } from "./picks.ts";
import { pixelOfWindow, windowAt } from "./view.ts";
import { freeName, fromSaved, History, isPair, merged, pairs, put, same, without } from "./picks.ts";

export type Side = "photo" | "model";

const FIT_FROM = 4;
/** Screen pixels per photo pixel at which a residual of one pixel can be judged. */
const CLOSE_SCALE = 1.5;
const FIT_PAUSE_MS = 120;

export class PickMode {
  readonly pane = new PhotoPane();
  readonly history = new History();
  photo: api.PhotoFacts | null = null;
  selected: string | null = null;
  fit: api.Fit | null = null;
  fitProblem = "";
  /** Whether the fit is older than the picks. */
  fitting = false;
  /** The other half of the selected pick, as predicted. */
  guess: api.Prediction | null = null;
  linked = true;
  snap = true;
  saved: "saved" | "saving" | "unsaved" = "saved";
  before: Camera | null = null;
  showBefore = false;
  cursors: Record<Side, Vec2 | null> = { photo: null, model: null };
  /** Whether a mark is held by the mouse. */
  dragging = false;
  private base: Picks = [];
  private version = "";
  private busy = false;
  private fitTimer = 0;
  private fitNumber = 0;

  constructor(readonly app: Host) {
    this.pane.onDraw = () => this.drawPhotoMarks();
    this.pane.onMove = () => this.linkModel();
    app.viewport.onFrame = () => this.drawModelMarks();
    app.viewport.onResize = () => this.linkModel();
    app.viewport.onWindow = () => this.linkPhoto();
  }

  get active(): boolean {
    return document.body.dataset.mode === "pick";
  }

  get picks(): Picks {
    return this.history.now;
  }

  get selectedPick(): Pick | null {
    return this.picks.find((pick) => pick.name === this.selected) ?? null;
  }

  /** The camera that predictions use: of the present picks, else of the last registration. */
  get camera(): Camera | null {
    return this.fit?.camera ?? this.photo?.camera ?? null;
  }

  async enter(photo: api.PhotoFacts): Promise<void> {
    await this.save();
    Object.assign(this, { photo, selected: null, fit: null, fitProblem: "", guess: null, before: null, showBefore: false });
    byId("photo-pane").hidden = false;
    this.history.reset([]);
    void this.pane.load(photo.name, photo.width!, photo.height!);
    this.pane.fit();
    const saved = await api.picks(photo.name);
    this.accept(saved);
    this.history.reset(fromSaved(saved.picks));
    this.refit();
    this.app.applyLook();
    if (photo.camera) this.lookThrough(true);
  }

  leave(): void {
    void this.save();
    document.body.dataset.mode = "view";
    byId("photo-pane").hidden = true;
    byId("loupe").hidden = true;
    drawMarks(byId("model-marks"), [], null);
    this.photo = null;
    this.app.viewport.exitPhoto();
    this.app.change({ opacity: 1 }); // of picking, where the model is seen below the photo
    this.app.show();
  }

  /** See the model through the photo's camera, or freely. */
  lookThrough(on: boolean): void {
    const camera = this.showBefore ? this.before : (this.photo?.camera ?? this.fit?.camera);
    if (on && camera) {
      this.app.viewport.enterPhoto(camera);
      void this.app.loadOverlay(this.photo!.name);
      this.app.change({ opacity: 0 });
      this.linkModel();
    } else {
      this.app.viewport.exitPhoto();
    }
    this.app.show();
  }

  /** Set a point on one side: the missing half of the selected pick, or a new pick. */
  place(side: Side, uv: Vec2 | null, hit: api.Hit | null): void {
    if (side === "photo" ? !uv || !this.pane.contains(uv) : !hit) return;
    const open = this.selectedPick && !isPair(this.selectedPick) ? this.selectedPick : null;
    const pick: Pick = open ?? { name: freeName(this.picks), uv: null, xyz: null, normal: null };
    const done = side === "photo" ? { ...pick, uv } : { ...pick, xyz: hit!.xyz, normal: hit!.normal };
    this.selected = done.name;
    this.guess = null;
    this.edit(put(this.picks, done));
    if (!isPair(done)) void this.predict(done);
  }

  /** Move one half of a pick. `final`: the end of a drag, a step that can be undone. */
  move(name: string, part: Partial<Pick>, final = true): void {
    const pick = this.picks.find((item) => item.name === name);
    if (!pick) return;
    const next = put(this.picks, { ...pick, ...part });
    if (final) this.edit(next);
    else {
      this.history.amend(next);
      this.refit();
      this.redraw();
    }
  }

  /** The end of a drag. */
  settle(): void {
    this.afterEdit();
  }

  acceptGuess(): boolean {
    const pick = this.selectedPick;
    if (!this.guess || !pick || isPair(pick)) return false;
    const { uv, xyz, normal } = this.guess;
    this.guess = null;
    this.edit(put(this.picks, { ...pick, uv: pick.uv ?? uv, xyz: pick.xyz ?? xyz, normal: pick.normal ?? normal }));
    return true;
  }

  remove(name: string): void {
    this.edit(without(this.picks, name));
    if (this.selected === name) this.select(null);
  }

  select(name: string | null): void {
    this.selected = name;
    this.guess = null;
    this.redraw();
    this.app.show();
  }

  /** Select a pick and bring it into the middle of both pictures. */
  flyTo(name: string): void {
    this.select(name);
    const pick = this.selectedPick;
    if (!pick) return;
    if (pick.uv) this.pane.show(pick.uv, CLOSE_SCALE);
    const { viewport } = this.app;
    if (pick.xyz && !(viewport.photoCamera && this.linked && pick.uv)) viewport.showPoint(pick.xyz);
  }

  step(direction: 1 | -1): void {
    const names = this.picks.map((pick) => pick.name);
    if (!names.length) return;
    const index = this.selected ? names.indexOf(this.selected) : direction > 0 ? -1 : 0;
    this.select(names[(index + direction + names.length) % names.length]);
  }

  undo(): void {
    this.history.undo();
    this.afterEdit();
  }

  redo(): void {
    this.history.redo();
    this.afterEdit();
  }

  async solve(): Promise<void> {
    await this.save();
    this.before = this.photo!.camera ?? null;
    await api.startJob("solve", this.photo!.name).catch((error: unknown) => this.app.complain(error));
  }

  onJob(job: api.Job): void {
    if (!this.active || job.kind !== "solve" || job.subject !== this.photo?.name || job.state !== "done") return;
    this.showBefore = false;
    void this.app.refresh().then(() => this.afterSolve());
  }

  onFiles(changed: string[]): void {
    const stem = this.photo?.name.replace(/\.[^.]*$/, "");
    if (this.active && changed.includes(`correspondences/${stem}.csv`)) void this.reload();
  }

  /** After the connection came back: save what is not saved, and see what is new. */
  async resume(): Promise<void> {
    if (!this.active || !this.photo) return;
    this.photo = this.app.photo;
    await this.save();
    await this.reload();
  }

  marks(side: Side): Mark[] {
    const factor = magnification(this.fit, this.pane.scale);
    const made = this.picks.map((pick) => this.markOf(pick, side, factor));
    return [...made, this.guessMark(side)].filter((mark) => mark !== null);
  }

  markUnder(side: Side, at: Vec2): Mark | null {
    return markUnder(this.marks(side), at);
  }

  redraw(): void {
    this.drawPhotoMarks();
    this.drawModelMarks();
  }

  private afterSolve(): void {
    if (!this.photo) return;
    this.photo = this.app.photo ?? this.photo;
    if (this.photo.camera) this.lookThrough(true);
    this.refit();
  }

  private markOf(pick: Pick, side: Side, factor: number): Mark | null {
    const at = this.screenOf(side, pick.uv, pick.xyz);
    if (!at) return null;
    const index = this.fit && isPair(pick) ? this.fit.names.indexOf(pick.name) : -1;
    const residual = index >= 0 ? this.fit!.residual_px[index] : null;
    const outlier = index >= 0 && !this.fit!.inliers[index];
    return {
      pick, at, outlier, guess: false,
      selected: pick.name === this.selected,
      away: side === "model" && !!pick.normal && !this.app.viewport.facing(pick.xyz!, pick.normal),
      tip: side === "photo" && index >= 0 ? this.tip(pick.uv!, index, factor) : undefined,
      amount: residual !== null && (outlier || pick.name === this.selected) ? `${residual.toFixed(1)} px` : undefined,
    };
  }

  private guessMark(side: Side): Mark | null {
    const pick = this.selectedPick;
    if (!this.guess || !pick || (side === "photo" ? pick.uv : pick.xyz)) return null;
    const at = this.screenOf(side, this.guess.uv, this.guess.xyz);
    return at && { pick, at, outlier: false, selected: true, away: false, guess: true };
  }

  private screenOf(side: Side, uv: Vec2 | null, xyz: Vec3 | null): Vec2 | null {
    if (side === "photo") return uv && this.pane.toScreen(uv);
    return xyz && this.app.viewport.toScreen(xyz);
  }

  private tip(uv: Vec2, index: number, factor: number): Vec2 | undefined {
    const [u, v] = this.fit!.projected[index];
    if (u === null || v === null) return undefined;
    const grown = this.fit!.inliers[index] ? factor : 1;
    return this.pane.toScreen([uv[0] + (u - uv[0]) * grown, uv[1] + (v - uv[1]) * grown]);
  }

  private drawPhotoMarks(): void {
    if (!this.active || !this.photo) return;
    const factor = magnification(this.fit, this.pane.scale);
    const enlarged = this.fit && factor > 1 ? ` \u00b7 residuals drawn ${factor} \u00d7` : "";
    byId("photo-title").textContent = this.photo.name + enlarged;
    drawMarks(byId("photo-marks"), this.marks("photo"), this.cursors.photo);
  }

  private drawModelMarks(): void {
    if (this.active) drawMarks(byId("model-marks"), this.marks("model"), this.cursors.model);
  }

  private edit(picks: Picks): void {
    this.history.add(picks);
    this.afterEdit();
  }

  private afterEdit(): void {
    if (this.selected && !this.selectedPick) this.selected = null;
    this.guess = null;
    this.saved = "unsaved";
    this.refit();
    this.redraw();
    this.app.show();
    void this.save();
  }

  /** Write until disk and screen agree; merges with what others wrote meanwhile. */
  async save(): Promise<void> {
    if (this.busy || !this.photo) return;
    this.busy = true;
    const photo = this.photo;
    try {
      while (this.photo === photo && JSON.stringify(pairs(this.picks)) !== JSON.stringify(pairs(this.base))) {
        this.saved = "saving";
        const sent = this.picks;
        const answer = await api.savePicks(photo.name, pairs(sent), this.version);
        if (this.photo !== photo) return;
        if (answer.conflict) this.merge(answer);
        else this.accept(answer);
      }
      this.saved = "saved";
    } catch (error) {
      this.saved = "unsaved";
      this.app.complain(error);
    } finally {
      this.busy = false;
      this.app.show();
    }
  }

  private accept(answer: api.SavedPicks): void {
    this.version = answer.version;
    this.base = fromSaved(answer.picks);
  }

  private merge(theirs: api.SavedPicks): void {
    const chosen = this.selectedPick;
    const [base, others] = [this.base, fromSaved(theirs.picks)];
    this.history.rebase((mine) => merged(base, mine, others));
    this.accept(theirs);
    if (chosen) this.selected = this.picks.find((pick) => same(pick, chosen))?.name ?? null; // may be renamed
    this.refit();
    this.redraw();
  }

  /** Take over what changed on disk. */
  private async reload(): Promise<void> {
    const photo = this.photo!;
    const saved = await api.picks(photo.name).catch((error: unknown) => this.app.complain(error));
    if (!saved || this.photo?.name !== photo.name || saved.version === this.version || this.busy) return;
    this.merge(saved);
    this.app.show();
  }

  private refit(): void {
    this.fitting = true;
    clearTimeout(this.fitTimer);
    this.fitTimer = window.setTimeout(() => void this.fitNow(), FIT_PAUSE_MS);
  }

  private async fitNow(): Promise<void> {
    const [photo, list, number] = [this.photo, pairs(this.picks), ++this.fitNumber];
    let found: api.Fit | null = null;
    let problem = "";
    if (photo && list.length >= FIT_FROM) {
      try {
        found = await api.fit(photo.name, list);
      } catch (error) {
        problem = error instanceof api.Refusal ? error.message : "The server does not answer.";
      }
    }
    if (number !== this.fitNumber) return;
    this.fitting = false;
    this.fit = found;
    this.fitProblem = problem;
    this.redraw();
    if (this.active) this.app.show();
  }

  private async predict(pick: Pick): Promise<void> {
    const camera = this.camera;
    if (!camera) return;
    const given = pick.uv ? { uv: pick.uv } : { xyz: pick.xyz! };
    const found = await api.predict(this.photo!.name, camera, given).catch(() => null);
    if (!found || this.selected !== pick.name || isPair(this.selectedPick!)) return;
    if (!this.snap && pick.xyz) found.uv = project(camera, pick.xyz) ?? found.uv;
    this.guess = found;
    this.redraw();
    this.app.show();
  }

  private linkModel(): void {
    if (!this.active || !this.linked || !this.app.viewport.photoCamera) return;
    const window = windowAt(this.app.viewport.photoCamera, this.pane.middle, this.pane.scale);
    if (window) this.app.viewport.setWindow(window);
  }

  private linkPhoto(): void {
    const { viewport } = this.app;
    if (!this.active || !this.linked || !viewport.photoCamera) return;
    const middle = pixelOfWindow(viewport.photoCamera, viewport.window);
    if (middle) this.pane.follow(middle, viewport.window.scale / viewport.photoCamera.f[0]);
  }
}

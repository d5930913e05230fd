// Picking: photo on the left, model on the right, pairs of points between them.

import * as api from "./api.ts";
import { byId } from "./dom.ts";
import type { Host } from "./host.ts";
import type { Camera, Vec2 } from "./lens.ts";
import { project } from "./lens.ts";
import { drawMarks } from "./marks.ts";
import { PhotoPane } from "./photopane.ts";
import { PickFit } from "./pickfit.ts";
import type { Side } from "./pickmarks.ts";
import { PickMarks } from "./pickmarks.ts";
import type { Pick, Picks } from "./picks.ts";
import { pixelOfWindow, windowAt } from "./view.ts";
import { freeName, fromSaved, History, isPair, merged, pairs, put, same, without } from "./picks.ts";

/** Screen pixels per photo pixel at which a residual of one pixel can be judged. */
const CLOSE_SCALE = 1.5;

export class PickMode {
  readonly pane = new PhotoPane();
  readonly history = new History();
  readonly marks = new PickMarks(this);
  photo: api.PhotoFacts | null = null;
  selected: string | null = null;
  readonly live = new PickFit(() => this.redrawAll());
  /** The number of the proposed point that Enter takes. */
  proposed = 0;
  /** Whether the camera was sought from the picks since the photo was entered. */
  solved = false;
  /** Whether a pick was set, moved or deleted since the photo was entered or solved. */
  edited = false;
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

  constructor(readonly app: Host) {
    this.pane.drawn.push(() => this.marks.drawPhoto());
    this.pane.onMove = () => this.linkModel();
    app.viewport.onFrame = () => this.marks.drawModel();
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

  /** The fit of the picks as they are, or as they were a moment ago. */
  get fit(): api.Fit | null {
    return this.live.found;
  }

  get fitting(): boolean {
    return this.live.busy;
  }

  /** The camera that predictions use: of the present picks, else of the last registration. */
  get camera(): Camera | null {
    return this.live.camera ?? this.photo?.camera ?? null;
  }

  /** The point of another photo that Enter takes; none while a pick waits for its other half. */
  get proposal(): api.Proposal | null {
    const open = this.selectedPick && !isPair(this.selectedPick);
    const all = this.live.proposals;
    return open || !all.length ? null : all[this.proposed % all.length];
  }

  async enter(photo: api.PhotoFacts): Promise<void> {
    await this.save();
    Object.assign(this, { photo, selected: null, guess: null, before: null, showBefore: false, edited: false, solved: false, proposed: 0 });
    this.live.reset();
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
    const camera = this.showBefore ? this.before : (this.photo?.camera ?? this.live.camera);
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

  /** Set the proposed point as a pick. */
  acceptProposal(proposal = this.proposal): boolean {
    if (!proposal) return false;
    const known = this.picks.some((pick) => pick.name === proposal.name);
    const name = known ? freeName(this.picks) : proposal.name;
    const { uv, xyz, normal } = proposal;
    this.live.proposals = this.live.proposals.filter((other) => other !== proposal);
    this.edit([...this.picks, { name, uv, xyz, normal }]);
    return true;
  }

  /** See where a proposed point should lie; Enter then takes it. */
  showProposal(proposal: api.Proposal): void {
    this.proposed = this.live.proposals.indexOf(proposal);
    this.select(null);
    this.pane.show(proposal.uv, CLOSE_SCALE);
    if (!(this.app.viewport.photoCamera && this.linked)) this.app.viewport.showPoint(proposal.xyz);
  }

  /** Count a pick in the fit, or see the fit without it; Solve judges all picks by itself. */
  use(name: string, on: boolean): void {
    if (on) this.live.off.delete(name);
    else this.live.off.add(name);
    this.refit();
    this.redrawAll();
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
    if (!this.selected && this.live.proposals.length) {
      this.proposed = (this.proposed + direction + this.live.proposals.length) % this.live.proposals.length;
      this.redrawAll();
      return;
    }
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
    await api.startJob("solve", { photo: this.photo!.name }).catch((error: unknown) => this.app.complain(error));
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

  redraw(): void {
    this.marks.drawPhoto();
    this.marks.drawModel();
  }

  private redrawAll(): void {
    this.redraw();
    if (this.active) this.app.show();
  }

  private afterSolve(): void {
    if (!this.photo) return;
    this.photo = this.app.photo ?? this.photo;
    this.solved = true;
    this.edited = false;
    if (this.photo.camera) this.lookThrough(true);
    this.refit();
    this.app.show();
  }

  private edit(picks: Picks): void {
    this.history.add(picks);
    this.afterEdit();
  }

  private afterEdit(): void {
    if (this.selected && !this.selectedPick) this.selected = null;
    this.guess = null;
    this.edited = true;
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
      while (this.photo?.name === photo.name && JSON.stringify(pairs(this.picks)) !== JSON.stringify(pairs(this.base))) {
        this.saved = "saving";
        const sent = this.picks;
        const answer = await api.savePicks(photo.name, pairs(sent), this.version);
        if (this.photo?.name !== photo.name) return;
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
    if (this.photo) this.live.seek(this.photo.name, pairs(this.picks), this.photo.camera ?? null);
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

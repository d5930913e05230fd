// The page: what is shown, and what a person can do about it.

import * as THREE from "three";
import * as api from "./api.ts";
import { byId } from "./dom.ts";
import { Edits } from "./edits.ts";
import { Home } from "./home.ts";
import type { Host } from "./host.ts";
import { LayerLoader, showLegend } from "./layers.ts";
import type { Camera, Vec2 } from "./lens.ts";
import { lockButtons, notice, runningJob, showJob } from "./notice.ts";
import type { Look } from "./panel.ts";
import { viewPanel, wholeSection } from "./panel.ts";
import { PhotoList, worstFirst } from "./photolist.ts";
import { MaskMode } from "./maskmode.ts";
import { maskPanel } from "./maskpanel.ts";
import { exposePictures } from "./exposure.ts";
import { download, modelSection } from "./modelpanel.ts";
import { PickHands } from "./pickhands.ts";
import { PickMode } from "./pickmode.ts";
import { pickPanel } from "./pickpanel.ts";
import { Places } from "./places.ts";
import { Relight } from "./relight.ts";
import { showTitle } from "./title.ts";
import { showStart } from "./startcard.ts";
import type { Layer } from "./surface.ts";
import { Viewport } from "./viewport.ts";

export class App implements Host {
  readonly viewport = new Viewport(byId<HTMLCanvasElement>("model-canvas"));
  facts: api.Facts | null = null;
  chosen: string | null = null;
  look: Look = {
    layer: "shaded", factor: "weights", exposure: 0, roughness: 0.55, light: [-0.35, 0.45], frustums: true, opacity: 1, wipe: 1,
  };
  readonly home = new Home(this.viewport);
  readonly picking = new PickMode(this);
  readonly hands = new PickHands(this.picking);
  readonly masks = new MaskMode(this, this.picking.pane);
  readonly places = new Places(this);
  readonly relight = new Relight(this);
  private readonly list = new PhotoList(() => this.show());
  private readonly edits = new Edits(this);
  private readonly loader = new LayerLoader(this.viewport.surface);
  private meshKey = "";
  private loadingWhole = false;
  private refreshing: Promise<void> | null = null;
  private again = false;
  /** The layer that was asked for last; one that arrives late and is another is not shown. */
  private wanted: Layer = "shaded";
  private startCard = true;

  /** Load everything anew; whatever did not change stays as it is. Ends when all that was known
   * when it was asked for is loaded. */
  refresh(): Promise<void> {
    this.again = true;
    return (this.refreshing ??= this.loadAll().finally(() => (this.refreshing = null)));
  }

  private async loadAll(): Promise<void> {
    try {
      while (this.again) {
        this.again = false;
        await this.load();
      }
    } catch (error) {
      this.complain(error);
    }
  }

  get photo(): api.PhotoFacts | null {
    return this.facts?.photos.find((photo) => photo.name === this.chosen) ?? null;
  }

  get photos(): api.PhotoFacts[] {
    return this.facts?.photos ?? [];
  }

  get unregistered(): number {
    return this.photos.filter(({ status }) => status !== "registered" && status !== "broken").length;
  }

  get mode(): string {
    return document.body.dataset.mode!;
  }

  complain(error: unknown): void {
    if (error instanceof api.Silence) return; // the lost connection is announced already
    if (!(error instanceof api.Refusal)) throw error;
    notice(error.message, "bad");
  }

  /** Photos that can be looked through, in the order of the list. */
  get viewable(): api.PhotoFacts[] {
    return worstFirst(this.facts?.photos ?? []).filter((photo) => photo.camera);
  }

  choose(photo: api.PhotoFacts): void {
    if (this.mode !== "view" && photo.width) {
      if (photo.name === this.chosen) return;
      void (this.mode === "pick" ? this.pick(photo) : this.mask(photo));
      return;
    }
    void this.edits.findSeenAlso(photo);
    if (photo.camera) this.view(photo);
    else {
      this.chosen = photo.name;
      this.viewport.exitPhoto();
      this.show();
    }
  }

  /** Fly into a photo. */
  view(photo: api.PhotoFacts): void {
    this.leaveMode();
    this.chosen = photo.name;
    if (this.look.layer === "weights") void this.setLayer("weights");
    this.viewport.enterPhoto(photo.camera!);
    void this.loadOverlay(photo.name);
    this.applyLook();
    this.show();
  }

  lookThrough(photo: string, camera: Camera): void {
    this.chosen = photo;
    this.viewport.enterPhoto(camera);
    void this.loadOverlay(photo);
    this.change({ opacity: 1, wipe: 0.5 });
    this.show();
  }

  exitPhoto(): void {
    this.viewport.exitPhoto();
    this.show();
  }

  /** Leave picking or painting. */
  private leaveMode(): void {
    if (this.mode === "pick") this.picking.leave();
    if (this.mode === "mask") this.masks.leave();
  }

  /** Paint the mask of a photo. */
  async mask(photo: api.PhotoFacts): Promise<void> {
    if (this.mode === "pick") this.picking.leave();
    this.chosen = photo.name;
    this.viewport.exitPhoto();
    document.body.dataset.mode = "mask";
    await this.masks.enter(photo);
    this.show();
  }

  private async leaveOut(photo: api.PhotoFacts, out: boolean): Promise<void> {
    if (this.chosen === photo.name) {
      this.leaveMode();
      this.viewport.exitPhoto();
      this.chosen = null;
    }
    await this.edits.leaveOut(photo, out);
  }

  async pick(photo: api.PhotoFacts): Promise<void> {
    if (this.mode === "mask") this.masks.leave();
    this.chosen = photo.name;
    this.viewport.exitPhoto();
    document.body.dataset.mode = "pick";
    await this.picking.enter(photo).catch((error: unknown) => this.complain(error));
    this.show();
  }

  async start(kind: string, more: { place?: number | null } = {}): Promise<void> {
    notice("");
    const job = await api.startJob(kind, more).catch((error: unknown) => this.complain(error));
    if (job) showJob(job);
    this.show();
  }

  /** Everything was made: show the model, and say what it is made of. */
  async madeModel(job: api.Job): Promise<void> {
    this.leaveMode();
    this.viewport.exitPhoto();
    await this.refresh();
    await this.setLayer(this.bestLayer());
    this.told(job);
  }

  /** What a job has to say about its result. */
  told(job: api.Job): void {
    if (!job.message || (job.kind === "solve" && this.mode === "pick")) return; // the panel tells it
    const all = this.facts?.photos.every((photo) => photo.status === "registered");
    notice(job.message, all ? "good" : "warn");
  }

  change(part: Partial<Look>): void {
    const { layer, factor, ...rest } = part;
    Object.assign(this.look, rest);
    this.applyLook();
    if (layer && layer !== this.wanted) void this.setLayer(layer);
    if (factor && factor !== this.look.factor) void this.setFactor(factor);
  }

  /** Whether the layer could be shown. */
  async setLayer(layer: Layer): Promise<boolean> {
    if (!this.available().has(layer)) return false;
    const photo = this.chosen ?? this.viewable[0]?.name ?? null;
    if (layer === "weights" && !this.chosen) this.chosen = photo;
    this.wanted = layer;
    if (layer !== this.look.layer) this.show();
    try {
      await this.loader.load(layer, this.facts!, photo, this.look.factor);
      if (layer === "relit") await this.relight.load(this.facts!.models["appearance.ply"]!);
    } catch (error) {
      if (this.wanted === layer) this.wanted = this.look.layer;
      this.complain(error);
      this.show();
      return false;
    }
    if (this.wanted !== layer) return false;
    this.look.layer = layer;
    this.viewport.surface.setLayer(layer);
    this.applyLook();
    this.show();
    return true;
  }

  /** Another part of the photo's weight. */
  private async setFactor(factor: string): Promise<void> {
    const before = this.look.factor;
    this.look.factor = factor;
    if (await this.setLayer("weights")) return;
    this.look.factor = before;
    this.show();
  }

  /** Which layers there is something to show for. */
  available(): Set<Layer> {
    const facts = this.facts;
    const layers: Layer[] = facts ? ["shaded", "normals", "ao"] : [];
    if (facts?.models["model.ply"]) layers.push("color");
    if (facts?.models["model.glb"]) layers.push("texture");
    if (facts?.models["appearance.ply"]) layers.push("base", "relit", "roughness", "metallic", "confidence");
    if (facts?.photos.some((photo) => photo.status === "registered")) layers.push("mean", "coverage", "source");
    if (this.photo ? this.photo.status === "registered" : layers.includes("source")) layers.push("weights");
    return new Set(layers);
  }

  /** Fly to the model point under a double click, and turn about it from now on. */
  async turnAbout(at: Vec2): Promise<void> {
    const found = await this.hit(at);
    if (found) this.viewport.turnAbout(new THREE.Vector3(...found.xyz).sub(this.viewport.surface.center));
  }

  /** The model point under a point of the canvas, exact. */
  async hit(at: Vec2): Promise<api.Hit | null> {
    const { origin, direction } = this.viewport.ray(at);
    return api.hit(origin, direction).catch((error: unknown) => {
      this.complain(error);
      return null;
    });
  }

  /** Draw lists and panels from what is known. */
  show(): void {
    if (!this.facts) return;
    const out = this.facts.excluded.map((name): api.PhotoFacts => ({ name, status: "excluded", advice: "", picks: 0 }));
    this.list.show([...this.facts.photos, ...out], this.chosen, this.look.layer === "source", {
      leaveOut: (photo, left) => void this.leaveOut(photo, left),
      view: (photo) => this.view(photo),
      pick: (photo) => void this.pick(photo),
      choose: (photo) => this.choose(photo),
    });
    this.showPanel();
    this.places.show(this.mode === "view");
    showStart(this.facts, this.startCard && this.mode === "view" && !runningJob() && !this.places.asking, {
      run: () => void this.start("run"),
      pick: (photo) => void this.pick(photo),
      close: () => {
        this.startCard = false;
        this.show();
      },
    });
    lockButtons();
    const inPhoto = this.viewport.photoCamera !== null;
    byId("model-title").textContent = inPhoto && this.mode === "view" ? this.places.title(`Through ${this.chosen}`) : "";
    byId("wipe").hidden = !(inPhoto || this.relight.splits) || this.mode !== "view";
    this.viewport.frustums.mark(this.chosen, null);
    showLegend(this.look.layer, this.loader.span);
    this.viewport.invalidate();
  }

  private showPanel(): void {
    const { surface } = this.viewport;
    const parts =
      this.mode === "pick"
        ? pickPanel(this.picking)
        : this.mode === "mask"
        ? maskPanel(this.masks, this)
        : viewPanel(this.look, this.wanted, this.home.up, this.available(), this.photo, this.viewport.photoCamera !== null, this.edits.seenAlso(this.chosen), {
            change: (part) => this.change(part),
            exitPhoto: () => this.exitPhoto(),
            setUp: (axis) => {
              this.home.setUp(axis);
              void this.edits.rememberUp(axis);
              this.show();
            },
            roll: (degrees) => this.viewport.roll((degrees * Math.PI) / 180),
            pick: (photo) => void this.pick(photo),
            mask: (photo) => void this.mask(photo),
            viewNamed: (name) => this.choose(this.facts!.photos.find((photo) => photo.name === name)!),
          });
    if (this.mode === "view" && surface.shownFaces < surface.faces) {
      parts.push(wholeSection(surface.shownFaces, surface.faces, this.loadingWhole, () => void this.loadWhole()));
    }
    if (this.mode === "view") parts.push(...this.relight.section(), ...this.places.section(), this.modelPart());
    byId("panel").replaceChildren(...parts);
  }

  private modelPart(): HTMLElement {
    return modelSection(this.facts!, {
      make: (to) => void this.edits.makeTo(to),
      film: () => void this.start("turntable"),
      takePicture: () => void download(this.viewport.picture(), `${this.facts!.name}.png`),
    });
  }

  applyLook(): void {
    const { surface, overlay, frustums } = this.viewport;
    surface.setExposure(this.look.exposure);
    this.viewport.wipe = this.look.wipe;
    this.relight.apply();
    surface.setRoughness(this.look.roughness);
    surface.setLightDirection(...this.look.light);
    overlay.setLook(this.look.opacity, this.look.wipe, this.look.exposure);
    exposePictures(this.look.exposure);
    frustums.group.visible = this.look.frustums && !this.viewport.photoCamera && this.mode === "view";
    const wipe = byId("wipe");
    wipe.style.left = `clamp(14px, ${this.look.wipe * 100}%, calc(100% - 14px))`;
    wipe.setAttribute("aria-valuenow", String(Math.round(this.look.wipe * 100)));
    this.viewport.invalidate();
  }

  private async load(): Promise<void> {
    const first = this.facts === null;
    this.facts = await api.facts();
    this.edits.forget();
    if (this.mode === "pick" && this.photo) this.picking.photo = this.photo;
    showTitle(this.facts!, this.viewport.surface);
    if (this.facts.mesh.key !== this.meshKey) await this.loadMesh();
    const { surface, frustums } = this.viewport;
    frustums.set(this.facts.photos, surface.center, surface.radius, () => this.viewport.invalidate());
    if (first) this.home.go(this.facts, this.viewable);
    if (first) this.viewport.onFirstFrame(() => (document.body.dataset.picture = "true"));
    const layer = first ? this.bestLayer() : this.wanted;
    if (first && !surface.whole) await this.setLayer("shaded").then(() => void this.setLayer(layer));
    else await this.setLayer(layer);
    this.followCamera();
    this.applyLook();
    await this.places.load();
    this.show();
    document.body.dataset.ready = "true";
    byId("loading").hidden = true;
  }

  /** The newer of the colored models, else bare shape. */
  private bestLayer(): Layer {
    const when = (name: string) => parseInt(this.facts!.models[name]?.split("-")[0] ?? "0", 16);
    if (!when("model.ply") && !when("model.glb")) return "shaded";
    return when("model.glb") > when("model.ply") ? "texture" : "color";
  }

  /** Of a large mesh the light one, which is all that most people look at. */
  private async loadMesh(): Promise<void> {
    const { surface } = this.viewport;
    surface.setFirst((await api.pack("/api/mesh/first"))!);
    this.loader.forget();
    this.meshKey = this.facts!.mesh.key;
    showTitle(this.facts!, surface);
    void this.loadLight();
  }

  /** All faces of a large mesh, once somebody asks for them. */
  async loadWhole(): Promise<void> {
    const { surface } = this.viewport;
    const key = this.meshKey;
    this.loadingWhole = true;
    this.show();
    const pack = await api.pack("/api/mesh/full").catch((error: unknown) => this.complain(error));
    this.loadingWhole = false;
    if (pack && key === this.meshKey) {
      surface.setFull(pack);
      this.loader.forget();
      await this.setLayer(this.wanted);
    }
    this.show();
  }

  /** The light mesh is made in the background; the page does not wait for it. */
  async loadLight(): Promise<void> {
    if (!this.viewport.surface.whole) return;
    const pack = await api.pack("/api/mesh/light").catch(() => null);
    if (!pack) return;
    this.viewport.surface.setLight(pack);
    if (this.look.layer === "texture") await this.loader.loadLightColors();
  }

  /** After a new registration of the photo on view, look through its new camera. */
  private followCamera(): void {
    const camera = this.photo?.camera;
    if (this.mode !== "view" || !this.viewport.photoCamera || !camera) return;
    if (JSON.stringify(camera) !== JSON.stringify(this.viewport.photoCamera)) this.viewport.enterPhoto(camera);
  }

  /** The photo over the view. */
  async loadOverlay(name: string): Promise<void> {
    const { overlay } = this.viewport;
    await overlay.load(name, (size) => {
      overlay.show(this.viewport.photoCamera !== null && !this.viewport.flying);
      this.viewport.invalidate();
      document.body.dataset.overlay = `${name} ${size}`;
    });
  }
}

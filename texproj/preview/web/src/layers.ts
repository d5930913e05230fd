// Fetches what a layer shows, and its legend.

import * as api from "./api.ts";
import { byId, el } from "./dom.ts";
import { css, RAMP } from "./ramps.ts";
import type { Layer, Surface } from "./surface.ts";

/** What is loaded, so that nothing is fetched twice. */
export class LayerLoader {
  private colors: string | null = null;
  private texture: string | null = null;
  private values = "";
  private gloss = "";
  private shot: string | null = null;

  constructor(private readonly surface: Surface) {}

  /** Everything must be fetched again: the mesh changed. */
  forget(): void {
    this.colors = this.texture = this.shot = null;
    this.values = this.gloss = "";
  }

  /** Bring in what `layer` needs. photo, factor: whose weights, and what of them. */
  async load(layer: Layer, facts: api.Facts, photo: string | null, factor: string): Promise<void> {
    if (layer === "color") await this.loadColors("/api/colors", facts.models["model.ply"]);
    else if (layer === "base" || layer === "relit") {
      await this.loadColors("/api/colors/base", facts.models["appearance.ply"]);
      if (facts.lit) await this.loadTexture(facts);
      if (layer !== "relit") return;
      await this.loadValues("ao", versionOf(facts), null);
      await this.loadGloss(String(facts.models["appearance.ply"]));
      await this.loadShot(facts.models["model.ply"]);
    }
    else if (layer === "mean") await this.loadMean(versionOf(facts));
    else if (layer === "texture") {
      await this.loadTexture(facts);
      this.colors = null;
      const colored = this.loadLightColors();
      if (!this.surface.whole) await colored;
    }
    else if (layer === "weights") await this.loadValues(factor, versionOf(facts), photo);
    else if (layer === "normals" && facts.lit) await this.loadTexture(facts);
    else if (layer === "roughness" || layer === "metallic" || layer === "confidence") {
      if (facts.lit && layer !== "confidence") await this.loadTexture(facts);
      await this.loadValues(layer, String(facts.models["appearance.ply"]), null);
    } else if (layer === "ao" || layer === "coverage" || layer === "source") {
      await this.loadValues(layer, versionOf(facts), null);
    }
  }

  private async loadColors(path: string, version: string | null): Promise<void> {
    const key = `${path} ${version}`;
    if (!version || this.colors === key) return;
    const pack = await api.pack(path);
    this.surface.setColors(pack!.arrays.rgba as Uint8Array);
    this.colors = key;
  }

  /** The colors of the light mesh come with those of the full one. */
  private async loadMean(version: string): Promise<void> {
    if (this.colors === `mean ${version}`) return;
    const pack = await api.pack("/api/colors/mean");
    this.surface.setColors(pack!.arrays.rgba as Uint8Array);
    this.colors = `mean ${version}`;
  }

  private async loadTexture(facts: api.Facts): Promise<void> {
    const version = facts.models["model.glb"];
    if (!version || !this.surface.whole) return;
    const key = `${version} ${facts.lit}`;
    if (this.texture !== key) await this.surface.loadTextured(`/api/models/model.glb?v=${version}`, facts.lit);
    this.texture = key;
  }

  /** Roughness and metals of the vertices, as bytes; matte where nothing tells. */
  private async loadGloss(version: string): Promise<void> {
    if (this.gloss === version) return;
    const packs = await Promise.all(["roughness", "metallic"].map((name) => api.pack(`/api/layers/${name}`)));
    const [rough, metal] = packs.map((pack) => pack!.arrays.values as Float32Array);
    const bytes = new Uint8Array(2 * rough.length);
    rough.forEach((value, i) => {
      bytes[2 * i] = value < 0 ? 255 : Math.round(255 * value);
      bytes[2 * i + 1] = Math.max(0, Math.round(255 * metal[i]));
    });
    this.surface.setGloss(bytes);
    this.gloss = version;
  }

  /** The colors as photographed, to be compared with. */
  private async loadShot(version: string | null): Promise<void> {
    if (!version || this.shot === version) return;
    this.surface.setShot((await api.pack("/api/colors"))!.arrays.rgba as Uint8Array);
    this.shot = version;
  }

  get hasShot(): boolean {
    return this.shot !== null;
  }

  /** While a textured model moves, or is not loaded, the light mesh with the texture's colors stands
   * for it. */
  async loadLightColors(): Promise<void> {
    if (!this.surface.hasLight || !(this.texture || !this.surface.whole)) return;
    const pack = await api.pack("/api/colors/light").catch(() => null);
    if (pack) this.surface.setLightColors(pack.arrays.rgba as Uint8Array);
  }

  private async loadValues(layer: string, version: string, photo: string | null): Promise<void> {
    const key = `${layer} ${version} ${photo}`;
    if (this.values === key) return;
    const query = photo ? `?photo=${encodeURIComponent(photo)}` : "";
    const pack = await api.pack(`/api/layers/${layer}${query}`);
    const values = pack!.arrays.values as Float32Array;
    this.surface.setValues(values, layer === "coverage" ? Math.max(highest(values), 1) : 1);
    this.span = highest(values);
    this.values = key;
  }

  span = 1;
}

/** Changes when a photo's camera does. */
function versionOf(facts: api.Facts): string {
  return facts.photos.map((photo) => (photo.camera ? photo.camera.t.join() : "-")).join(";");
}

function highest(values: Float32Array): number {
  let top = 0;
  for (const value of values) if (value > top) top = value;
  return top;
}

export function showLegend(layer: Layer, span: number): void {
  const legend = byId("legend");
  const unseen = el("div", {}, el("span", {}, el("span", { class: "hatch" }), "no photo sees it"));
  const rows: Partial<Record<Layer, () => Node[]>> = {
    color: () => [unseen],
    base: () => [unseen],
    relit: () => [unseen],
    roughness: () => [rampBar(), ends("a mirror", "matte"), unseen],
    metallic: () => [rampBar(), ends("no metal", "metal"), unseen],
    confidence: () => [rampBar(), ends("unsure", "sure"), unseen],
    mean: () => [el("div", {}, "Doubled edges: a photo is off"), unseen],
    coverage: () => [rampBar(), ends("1 photo", `${Math.round(span)} photos`), unseen],
    weights: () => [rampBar(), ends("counts little", "counts fully"), unseen],
    source: () => [el("div", {}, "Colors: see the list of photos"), unseen],
  };
  const made = rows[layer]?.() ?? [];
  legend.hidden = made.length === 0;
  legend.replaceChildren(...made);
}

function ends(left: string, right: string): HTMLElement {
  return el("div", {}, el("span", {}, left), el("span", {}, right));
}

function rampBar(): HTMLCanvasElement {
  const canvas = el("canvas", { width: 256, height: 1 });
  const context = canvas.getContext("2d")!;
  RAMP.forEach((rgb, i) => {
    context.fillStyle = css(rgb);
    context.fillRect(i, 0, 1, 1);
  });
  return canvas;
}

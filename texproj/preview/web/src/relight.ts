// The surface that `appearance` found, in another light: a sun, a sky, and how they are exposed.

import * as THREE from "three";
import type { Lights } from "./api.ts";
import * as api from "./api.ts";
import type { Host } from "./host.ts";
import type { Choice, Sky } from "./lightchoice.ts";
import { SKIES, TONES } from "./lightchoice.ts";
import { luminance, metered } from "./lightmath.ts";
import { relightSection } from "./relightpanel.ts";
import { SunShadow } from "./sunshadow.ts";

/** ISO 12232's EV: texproj/appearance/relight/tone.py. */
const SATURATION = 1.2;
const METERED = 2000;

export class Relight {
  choice: Choice = { sun: true, heading: -50, height: 40, kelvin: 5500, sky: "overcast", tone: "filmic", split: false };
  lights: Lights | null = null;
  /** How it is exposed, as a camera meters: the exposure value at ISO 100. */
  ev = 0;
  private readonly shadow = new SunShadow();
  private version = "";

  constructor(private readonly app: Host) {}

  /** Bring in the lights that there are; once for each appearance. */
  async load(version: string): Promise<void> {
    if (this.version === version) return;
    this.lights = await api.lights();
    this.version = version;
    if (!this.lights.skies[this.choice.sky]) this.choice.sky = "overcast";
  }

  change(part: Partial<Choice>): void {
    const sun = part.sky === "photographed" ? this.lights?.sun : null;
    Object.assign(this.choice, part, sun ? this.anglesOf(sun.direction) : {});
    this.apply();
    this.app.viewport.invalidate();
  }

  /** Hand the light to the surface's shader. */
  apply(): void {
    const { surface } = this.app.viewport;
    if (!this.lights || surface.layer !== "relit") return;
    const toSun = this.toSun();
    const sunlight = this.sunlight();
    const sky = this.lights.skies[this.choice.sky] ?? Array.from({ length: 9 }, () => [0, 0, 0] as api.Rgb);
    const exposure = metered(surface.sample(METERED), sky, toSun, sunlight);
    this.ev = Math.log2(1 / (SATURATION * exposure));
    const shadow = this.choice.sun ? this.shadow.cast(this.app.viewport, toSun) : null;
    this.app.viewport.beside = this.splits && surface.hasTextured ? "texture" : null;
    surface.setRelight({
      sky: sky.map((rgb) => new THREE.Vector3(...rgb)), toSun, sunlight, metered: exposure, tone: TONES.indexOf(this.choice.tone), shadow,
    });
  }

  /** The panel of the light, where it shows. */
  section(): HTMLElement[] {
    if (!this.lights || this.app.look.layer !== "relit") return [];
    const skies = Object.entries(SKIES).filter(([name]) => name === "none" || this.lights!.skies[name as Sky]);
    const { hasTextured } = this.app.viewport.surface;
    return [relightSection(this.choice, { skies, splits: hasTextured }, () => this.ev, (part) => {
      this.change(part);
      if (part.split) this.app.change({ wipe: 0.5 });
      if (part.split !== undefined || part.sky) this.app.show();
    })];
  }

  /** Whether what was photographed is shown beside it. */
  get splits(): boolean {
    const { surface, photoCamera } = this.app.viewport;
    return this.choice.split && surface.layer === "relit" && !photoCamera && document.body.dataset.mode === "view";
  }

  /** Direction to the sun, the scan's axes. */
  private toSun(): THREE.Vector3 {
    const { up, front, right } = this.lights!;
    const [heading, height] = [this.choice.heading, this.choice.height].map((degrees) => (degrees * Math.PI) / 180);
    const across = new THREE.Vector3(...front).multiplyScalar(Math.cos(heading)).addScaledVector(new THREE.Vector3(...right), Math.sin(heading));
    return across.multiplyScalar(Math.cos(height)).addScaledVector(new THREE.Vector3(...up), Math.sin(height));
  }

  private anglesOf(direction: api.Rgb): { heading: number; height: number } {
    const { up, front, right } = this.lights!;
    const along = (axis: api.Rgb) => new THREE.Vector3(...axis).dot(new THREE.Vector3(...direction));
    const degrees = (radians: number) => (radians * 180) / Math.PI;
    return { heading: degrees(Math.atan2(along(right), along(front))), height: degrees(Math.asin(Math.min(1, along(up)))) };
  }

  /** Irradiance square to the sun: of the photos' own under their sky, else of a clear day. */
  private sunlight(): THREE.Vector3 {
    const { kelvin, sky, sun } = this.choice;
    if (!sun) return new THREE.Vector3();
    const { sun: found, sun_lux: lux, kelvin: known, tints } = this.lights!;
    const nearest = known.reduce((best, value, k) => (Math.abs(value - kelvin) < Math.abs(known[best] - kelvin) ? k : best), 0);
    const own = () => (found ? luminance(found.irradiance) : skyLight(this.lights!.skies.photographed!));
    return new THREE.Vector3(...tints[nearest]).multiplyScalar(sky === "photographed" ? own() : lux);
  }
}

/** A sun where the photos had none: some times as bright as their sky is on the mean. */
const skyLight = (sky: api.Rgb[]) => 4 * luminance(sky[0]) * 0.28209479;

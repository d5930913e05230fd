// The surface that `appearance` found, in another light: a sun, a sky, and how they are exposed.

import * as THREE from "three";
import type { Lights } from "./api.ts";
import * as api from "./api.ts";
import type { Host } from "./host.ts";
import type { Vec3 } from "./lens.ts";
import type { Choice, Sky } from "./lightchoice.ts";
import { SKIES, TONES } from "./lightchoice.ts";
import { luminance, metered } from "./lightmath.ts";
import { materialSection } from "./materialspheres.ts";
import { notice } from "./notice.ts";
import { relightSection } from "./relightpanel.ts";
import type { SkyAxes, SkyPicture } from "./skypicture.ts";
import { irradianceOf, MIRROR, mirrored, parted, pictureOf, readSky } from "./skypicture.ts";

import type { Layer } from "./surface.ts";
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
  private readonly mirror = mirrorTexture();
  private mirrorOf = "";
  private mirrorUnit = 0;
  private materials: api.Material[] = [];
  /** The picture that was chosen, its sun, and a name. */
  private own: { name: string; rest: SkyPicture; sun: api.Lights["sun"] } | null = null;
  private version = "";

  constructor(private readonly app: Host) {}

  /** Bring in the lights that there are; once for each appearance. */
  async load(version: string): Promise<void> {
    if (this.version === version) return;
    [this.lights, this.materials] = await Promise.all([api.lights(), api.materials()]);
    this.version = version;
    this.mirrorOf = "";
    if (this.own) this.take(this.own.name, this.own.rest, this.own.sun);
    if (!this.lights.skies[this.choice.sky]) this.choice.sky = "overcast";
  }

  /** Light by a picture of all directions; its sun is a sun. */
  async open(file: File): Promise<void> {
    try {
      const { rest, sun } = parted(await readSky(file));
      const { right, up, ahead } = this.axes();
      const world = (d: Vec3) => [0, 1, 2].map((k) => d[0] * right[k] + d[1] * up[k] + d[2] * ahead[k]) as Vec3;
      this.take(file.name, rest, sun && { direction: world(sun.toward), irradiance: sun.irradiance });
    } catch (error) {
      notice(error instanceof Error ? error.message : String(error), "bad");
      return;
    }
    notice("");
    this.change({ sky: "picture", sun: this.own!.sun !== null });
    this.app.show();
  }

  private take(name: string, rest: SkyPicture, sun: api.Lights["sun"]): void {
    this.own = { name, rest, sun };
    this.lights!.skies.picture = irradianceOf(rest, this.axes());
    this.mirrorOf = "";
  }

  /** Of pictures: their middle is behind the piece, as `texproj relight` has it. */
  private axes(): SkyAxes {
    const { up, front, right } = this.lights!;
    return { right, up, ahead: front.map((x) => -x) as Vec3 };
  }

  /** What mirrors show of the sky; made anew where it is another. */
  private reflect(): void {
    const { sky } = this.choice;
    if (this.mirrorOf === sky) return;
    this.mirrorOf = sky;
    const irradiance = this.lights!.skies[sky];
    const picture = sky === "picture" ? this.own!.rest : irradiance && sky !== "none" ? pictureOf(irradiance, this.axes()) : null;
    if (!picture) {
      this.mirrorUnit = 0;
      return;
    }
    const { data, unit } = mirrored(picture);
    (this.mirror.image.data as Uint16Array).set(data);
    this.mirror.needsUpdate = true;
    this.mirrorUnit = unit;
  }

  change(part: Partial<Choice>): void {
    const sun = part.sky === "photographed" ? this.lights?.sun : part.sky === "picture" ? this.own?.sun : null;
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
    this.app.viewport.beside = this.splits ? this.beside : null;
    this.reflect();
    const { right, up, ahead } = this.axes();
    surface.setRelight({
      sky: sky.map((rgb) => new THREE.Vector3(...rgb)), toSun, sunlight, metered: exposure, tone: TONES.indexOf(this.choice.tone), shadow,
      mirror: this.mirror, mirrorUnit: this.mirrorUnit, skyFromScan: new THREE.Matrix3(...right, ...up, ...ahead),
    });
  }

  /** The layer that shows what was photographed; null where none does. */
  private get beside(): Layer | null {
    const { facts } = this.app;
    if (facts?.models["model.ply"]) return "photographed";
    return facts?.models["model.glb"] && !facts.lit && this.app.viewport.surface.hasTextured ? "texture" : null;
  }

  /** The panel of the light, where it shows. */
  section(): HTMLElement[] {
    if (!this.lights || this.app.look.layer !== "relit") return [];
    const skies = Object.entries(SKIES).filter(([name]) => name === "none" || this.lights!.skies[name as Sky]);
    const offer = { skies, splits: this.beside !== null, picture: this.own?.name ?? null, open: (file: File) => void this.open(file) };
    const light = relightSection(this.choice, offer, () => this.ev, (part) => {
      this.change(part);
      if (part.split) this.app.change({ wipe: 0.5 });
      if (part.split !== undefined || part.sky) this.app.show();
    });
    return this.materials.length ? [light, materialSection(this.materials)] : [light];
  }

  /** Whether what was photographed is shown beside it. */
  get splits(): boolean {
    const { surface, photoCamera } = this.app.viewport;
    return this.choice.split && this.beside !== null && surface.layer === "relit" && !photoCamera && document.body.dataset.mode === "view";
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
    const own = () => skyLight(this.lights!.skies[sky]!);
    if (sky === "photographed" && found) return new THREE.Vector3(...found.irradiance);
    if (sky === "picture" && this.own?.sun) return new THREE.Vector3(...this.own.sun.irradiance);
    const strength = sky === "photographed" || sky === "picture" ? own() : lux;
    return new THREE.Vector3(...tints[nearest]).multiplyScalar(strength);
  }
}

/** Layers of growing roughness, repeated around. */
function mirrorTexture(): THREE.DataArrayTexture {
  const { width, height, layers } = MIRROR;
  const texture = new THREE.DataArrayTexture(new Uint16Array(4 * width * height * layers), width, height, layers);
  texture.type = THREE.HalfFloatType;
  texture.magFilter = texture.minFilter = THREE.LinearFilter;
  texture.wrapS = THREE.RepeatWrapping;
  return texture;
}

/** A sun where the photos had none: some times as bright as their sky is on the mean. */
const skyLight = (sky: api.Rgb[]) => 4 * luminance(sky[0]) * 0.28209479;

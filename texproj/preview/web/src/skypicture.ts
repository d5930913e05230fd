// Light from all directions as a picture: read from a file, parted from its sun, summed and blurred.

import { DataUtils, FloatType } from "three";
import { EXRLoader } from "three/addons/loaders/EXRLoader.js";
import { HDRLoader } from "three/addons/loaders/HDRLoader.js";
import type { Vec3 } from "./lens.ts";
import { luminance } from "./lightmath.ts";

/** Linear light; the top row is overhead, the middle column ahead, columns run to the right. Twin: texproj/appearance/relight/environment.py. */
export interface SkyPicture {
  width: number;
  height: number;
  rgb: Float32Array;
}

/** Right, up and ahead of a picture, the scan's axes. */
export interface SkyAxes {
  right: Vec3;
  up: Vec3;
  ahead: Vec3;
}

const LARGEST = 512;
const SUN_OVER_MEAN = 20;
const SUN_WIDE = Math.cos((5 * Math.PI) / 180);
const SUN_SHARE = 0.1;

/** A picture of a file, .hdr or .exr, reduced. Throws an Error that says what is wrong. */
export async function readSky(file: File): Promise<SkyPicture> {
  const data = await file.arrayBuffer();
  const exr = file.name.toLowerCase().endsWith(".exr");
  let found: { width: number; height: number; data: ArrayLike<number> };
  try {
    found = exr ? new EXRLoader().setDataType(FloatType).parse(data) as typeof found : new HDRLoader().setDataType(FloatType).parse(data) as typeof found;
  } catch {
    throw new Error(`${file.name} cannot be read as a picture of light; give a Radiance .hdr or an OpenEXR file`);
  }
  const { width, height } = found;
  if (width !== 2 * height) throw new Error(`${file.name} is ${width} \u00d7 ${height}; a picture of all directions is twice as wide as high`);
  const channels = found.data.length / (width * height);
  const rgb = new Float32Array(3 * width * height);
  for (let row = 0; row < height; row++) {
    const from = exr ? height - 1 - row : row; // OpenEXR's rows come from below
    for (let x = 0; x < width; x++) {
      for (let k = 0; k < 3; k++) {
        const value = found.data[(from * width + x) * channels + Math.min(k, channels - 1)];
        rgb[3 * (row * width + x) + k] = Number.isFinite(value) ? Math.max(value, 0) : 0;
      }
    }
  }
  return reduced({ width, height, rgb }, LARGEST);
}

/** The picture at most so wide, by means of blocks of texels. */
export function reduced(picture: SkyPicture, most: number): SkyPicture {
  let now = picture;
  while (now.width > most && now.width % 2 === 0 && now.height % 2 === 0) now = halved(now);
  return now;
}

function halved({ width, height, rgb }: SkyPicture): SkyPicture {
  const [w, h] = [width / 2, height / 2];
  const out = new Float32Array(3 * w * h);
  for (let y = 0; y < h; y++) {
    for (let x = 0; x < w; x++) {
      for (let k = 0; k < 3; k++) {
        const at = 3 * (2 * y * width + 2 * x) + k;
        out[3 * (y * w + x) + k] = (rgb[at] + rgb[at + 3] + rgb[at + 3 * width] + rgb[at + 3 * width + 3]) / 4;
      }
    }
  }
  return { width: w, height: h, rgb: out };
}

/** Of each texel its direction, to the right, up, ahead, and its solid angle. */
function* texels({ width, height }: { width: number; height: number }): Generator<[number, Vec3, number]> {
  for (let y = 0; y < height; y++) {
    const above = Math.PI / 2 - ((y + 0.5) / height) * Math.PI;
    const [level, up] = [Math.cos(above), Math.sin(above)];
    const solid = level * ((2 * Math.PI) / width) * (Math.PI / height);
    for (let x = 0; x < width; x++) {
      const around = ((x + 0.5) / width) * 2 * Math.PI - Math.PI;
      yield [y * width + x, [level * Math.sin(around), up, level * Math.cos(around)], solid];
    }
  }
}

/** The picture without its sun, the direction of that, to the right, up, ahead, and its irradiance square to it; null where no spot is so bright. */
export function parted(picture: SkyPicture): { rest: SkyPicture; sun: { toward: Vec3; irradiance: Vec3 } | null } {
  const { rgb } = picture;
  const light = (i: number) => luminance([rgb[3 * i], rgb[3 * i + 1], rgb[3 * i + 2]]);
  let [total, solids, top, brightest] = [0, 0, -1, [0, 0, 1] as Vec3];
  for (const [i, d, solid] of texels(picture)) {
    const value = light(i);
    total += value * solid;
    solids += solid;
    if (value > top) [top, brightest] = [value, d];
  }
  const irradiance: Vec3 = [0, 0, 0], toward: Vec3 = [0, 0, 0];
  const rest = { ...picture, rgb: rgb.slice() };
  const inside: number[] = [], around: number[] = [];
  for (const [i, d, solid] of texels(picture)) {
    if (dot(d, brightest) <= SUN_WIDE) continue;
    if (light(i) <= (SUN_OVER_MEAN * total) / solids) {
      around.push(i);
      continue;
    }
    inside.push(i);
    for (let k = 0; k < 3; k++) irradiance[k] += rgb[3 * i + k] * solid;
    for (let k = 0; k < 3; k++) toward[k] += d[k] * light(i) * solid;
  }
  if (!inside.length || luminance(irradiance) < SUN_SHARE * total) return { rest: picture, sun: null };
  for (let k = 0; k < 3; k++) {
    const values = around.map((i) => rgb[3 * i + k]).sort((a, b) => a - b);
    const usual = values.length ? values[values.length >> 1] : total / solids;
    for (const i of inside) rest.rgb[3 * i + k] = usual;
  }
  const length = Math.hypot(...toward);
  return { rest, sun: { toward: toward.map((x) => x / length) as Vec3, irradiance } };
}

const GAINS = [Math.PI, ...Array(3).fill((2 * Math.PI) / 3), ...Array(5).fill(Math.PI / 4)] as number[];

/** Nine spherical harmonics of the irradiance of an open surface; twin: texproj/preview/lights.py. */
export function irradianceOf(picture: SkyPicture, axes: SkyAxes): Vec3[] {
  const small = reduced(picture, 64);
  const out = Array.from({ length: 9 }, () => [0, 0, 0] as Vec3);
  for (const [i, d, solid] of texels(small)) {
    const values = basis(inScan(d, axes));
    for (let m = 0; m < 9; m++) {
      for (let k = 0; k < 3; k++) out[m][k] += GAINS[m] * values[m] * solid * small.rgb[3 * i + k];
    }
  }
  return out;
}

/** The picture of a sky that is told by harmonics of its irradiance. */
export function pictureOf(irradiance: Vec3[], axes: SkyAxes): SkyPicture {
  const size = { width: 128, height: 64 };
  const rgb = new Float32Array(3 * size.width * size.height);
  for (const [i, d] of texels(size)) {
    const values = basis(inScan(d, axes));
    for (let k = 0; k < 3; k++) {
      const radiance = values.reduce((sum, value, m) => sum + (value * irradiance[m][k]) / GAINS[m], 0);
      rgb[3 * i + k] = Math.max(radiance, 0);
    }
  }
  return { ...size, rgb };
}

function inScan([x, y, z]: Vec3, { right, up, ahead }: SkyAxes): Vec3 {
  return [0, 1, 2].map((k) => x * right[k] + y * up[k] + z * ahead[k]) as Vec3;
}

/** Order as in texproj/appearance/harmonics.py. */
function basis([x, y, z]: Vec3): number[] {
  return [
    0.28209479, 0.48860251 * y, 0.48860251 * z, 0.48860251 * x, 1.09254843 * x * y, 1.09254843 * y * z,
    0.31539157 * (3 * z * z - 1), 1.09254843 * x * z, 0.54627422 * (x * x - y * y),
  ];
}

/** Roughness of the blurred copies, with 0 before them; surface.frag.glsl has them too. */
const ROUGHNESSES = [0.15, 0.3, 0.5, 0.75, 1];
const SOURCES = [512, 256, 128, 64, 64];
const SAMPLES = 96;
export const MIRROR = { width: 256, height: 128, layers: ROUGHNESSES.length + 1 };

/** What mirrors of growing roughness show, as half floats RGBA, layer by layer, the bottom row first; over `unit`. B. Karis, "Real shading in Unreal Engine 4", 2013. */
export function mirrored(picture: SkyPicture): { data: Uint16Array; unit: number } {
  const { width, height, layers } = MIRROR;
  const unit = Math.max(meanOf(picture), 1e-12);
  const data = new Uint16Array(4 * width * height * layers);
  const color: Vec3 = [0, 0, 0];
  for (let layer = 0; layer < layers; layer++) {
    const level = layer === 0 ? reduced(picture, 2 * width) : blurred(reduced(picture, SOURCES[layer - 1]), ROUGHNESSES[layer - 1]);
    for (const [i, d] of texels({ width, height })) {
      const at = 4 * (((layer + 1) * height - 1 - Math.floor(i / width)) * width + (i % width));
      lookedUp(level, ...d, color);
      for (let k = 0; k < 3; k++) data[at + k] = DataUtils.toHalfFloat(Math.min(color[k] / unit, 60000));
      data[at + 3] = DataUtils.toHalfFloat(1);
    }
  }
  return { data, unit };
}

function meanOf(picture: SkyPicture): number {
  let [sum, solids] = [0, 0];
  for (const [i, , solid] of texels(picture)) {
    sum += solid * luminance([picture.rgb[3 * i], picture.rgb[3 * i + 1], picture.rgb[3 * i + 2]]);
    solids += solid;
  }
  return sum / solids;
}

/** The mean of what facets of a GGX mirror show that is looked at from straight ahead: Walter et al. 2007, eq. 35. */
function blurred(picture: SkyPicture, roughness: number): SkyPicture {
  const size = { width: 64, height: 32 };
  const rgb = new Float32Array(3 * size.width * size.height);
  const alpha2 = roughness ** 4;
  const facets: [number, number, number][] = [];
  for (let n = 0; n < SAMPLES; n++) {
    const u = (n + 0.5) / SAMPLES;
    const toward = (2 * (1 - u)) / (1 + (alpha2 - 1) * u) - 1;
    const turn = n * Math.PI * (3 - Math.sqrt(5));
    const across = Math.sqrt(Math.max(1 - toward * toward, 0));
    if (toward > 0) facets.push([toward, across * Math.cos(turn), across * Math.sin(turn)]);
  }
  const color: Vec3 = [0, 0, 0];
  const total = facets.reduce((sum, [toward]) => sum + toward, 0);
  for (const [i, d] of texels(size)) {
    const [a, b] = tangents(d);
    for (const [toward, x, y] of facets) {
      lookedUp(picture, toward * d[0] + x * a[0] + y * b[0], toward * d[1] + x * a[1] + y * b[1], toward * d[2] + x * a[2] + y * b[2], color);
      for (let k = 0; k < 3; k++) rgb[3 * i + k] += (toward / total) * color[k];
    }
  }
  return { ...size, rgb };
}

/** Between texels, bilinearly. out: where the color goes, so that a million looks make no litter. */
export function lookedUp({ width, height, rgb }: SkyPicture, right: number, up: number, ahead: number, out: Vec3): Vec3 {
  const x = (Math.atan2(right, ahead) / (2 * Math.PI) + 0.5) * width - 0.5;
  const y = (0.5 - Math.asin(up > 1 ? 1 : up < -1 ? -1 : up) / Math.PI) * height - 0.5;
  const [x0, y0] = [Math.floor(x), Math.floor(y)];
  const top = 3 * (y0 < 0 ? 0 : y0) * width, below = 3 * (y0 + 1 >= height ? height - 1 : y0 + 1) * width;
  const left = 3 * ((x0 + width) % width), next = 3 * ((x0 + 1 + width) % width);
  const fx = x - x0, fy = y - y0;
  for (let k = 0; k < 3; k++) {
    const upper = (1 - fx) * rgb[top + left + k] + fx * rgb[top + next + k];
    out[k] = (1 - fy) * upper + fy * ((1 - fx) * rgb[below + left + k] + fx * rgb[below + next + k]);
  }
  return out;
}

function tangents([x, y, z]: Vec3): [Vec3, Vec3] {
  const sign = z < 0 ? -1 : 1;
  const a = -1 / (sign + z);
  const b = x * y * a;
  return [[1 + sign * x * x * a, sign * b, -sign * x], [b, sign + y * y * a, -y]];
}

const dot = (a: Vec3, b: Vec3) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

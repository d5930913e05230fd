// What the surface is made of: a sphere of each material, and its numbers.

import type { Material } from "./api.ts";
import { el, section } from "./dom.ts";
import type { Vec3 } from "./lens.ts";

const SIZE = 72;
/** To the lamp: from the upper left, before the sphere. */
const LAMP = unit([-0.5, 0.6, 0.8]);
const AROUND = 0.25;

export function materialSection(materials: Material[]): HTMLElement {
  const rows = materials.map((one) => el("li", {}, sphere(one), el("div", {}, el("b", {}, titled(one)), el("span", { class: "hint" }, numbers(one)))));
  return section("Materials", el("ul", { id: "materials" }, ...rows));
}

const titled = (one: Material) => `${one.metallic ? "Metal" : "Paint"}, ${Math.round(100 * one.share)} %`;

function numbers({ roughness, metallic, f0 }: Material): string {
  const mirror = metallic ? "" : f0 === null ? ", mirrors about 4 %" : `, mirrors ${(100 * f0).toFixed(1)} %`;
  return `roughness ${roughness.toFixed(2)}${mirror}`;
}

function sphere(one: Material): HTMLCanvasElement {
  const canvas = el("canvas", { width: SIZE, height: SIZE, role: "img", "aria-label": `Sphere of ${one.name}` });
  const context = canvas.getContext("2d")!;
  const image = context.createImageData(SIZE, SIZE);
  for (let i = 0; i < SIZE * SIZE; i++) {
    const [x, y] = [((i % SIZE) + 0.5) / (SIZE / 2) - 1, 1 - (Math.floor(i / SIZE) + 0.5) / (SIZE / 2)];
    const square = x * x + y * y;
    const edge = (1 - Math.sqrt(square)) * (SIZE / 2);
    if (edge <= 0) continue;
    const color = shaded(one, [x, y, Math.sqrt(1 - square)]);
    for (let k = 0; k < 3; k++) image.data[4 * i + k] = Math.round(255 * encoded(color[k]));
    image.data[4 * i + 3] = Math.round(255 * Math.min(edge, 1));
  }
  context.putImageData(image, 0, 0);
  return canvas;
}

/** Linear light of a sphere whose normal is `n`, looked at along z: one lamp and even light around. Twin: surface.frag.glsl. */
export function shaded({ base_color, metallic, roughness, f0 }: Pick<Material, "base_color" | "metallic" | "roughness" | "f0">, n: Vec3): Vec3 {
  const base = base_color ?? [0.35, 0.35, 0.35];
  const nv = Math.max(n[2], 1e-3), nl = Math.max(dot(n, LAMP), 0);
  const h = unit([LAMP[0], LAMP[1], LAMP[2] + 1]);
  const rise = (1 - h[2]) ** 5, lobe = nl > 0 ? ggx(roughness, nl, nv, Math.max(dot(n, h), 0)) : 0;
  return base.map((color) => {
    const f = metallic ? color : (f0 ?? 0.04);
    const matte = metallic ? 0 : color / Math.PI;
    return Math.PI * nl * (matte + lobe * (f + (1 - f) * rise)) + AROUND * (Math.PI * matte + f + (1 - f) * (1 - nv) ** 5 * (1 - roughness));
  }) as Vec3;
}

/** D V, as in texproj/appearance/flash/reflection.py. */
export function ggx(roughness: number, nl: number, nv: number, nh: number): number {
  const a2 = roughness ** 4;
  const d = nh * nh * (a2 - 1) + 1;
  const hidden = nl * Math.sqrt(nv * nv * (1 - a2) + a2) + nv * Math.sqrt(nl * nl * (1 - a2) + a2);
  return ((a2 / (Math.PI * d * d)) * 0.5) / hidden;
}

const encoded = (c: number) => {
  const x = Math.min(c / (1 + 0.25 * c), 1); // a highlight is not cut at once
  return x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055;
};

const dot = (a: Vec3, b: Vec3) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

function unit(v: Vec3): Vec3 {
  const length = Math.hypot(...v);
  return v.map((x) => x / length) as Vec3;
}

// Colors that stand for values.

import * as THREE from "three";

type Rgb = [number, number, number];

/** Dark blue over green to yellow, even steps of lightness (anchors of the viridis map). */
const ANCHORS: Rgb[] = [
  [68, 1, 84], [65, 68, 135], [42, 120, 142], [34, 168, 132], [122, 209, 81], [253, 231, 37],
];

export const RAMP: Rgb[] = Array.from({ length: 256 }, (_, i) => {
  const at = (i / 255) * (ANCHORS.length - 1);
  const k = Math.min(Math.floor(at), ANCHORS.length - 2);
  return ANCHORS[k].map((a, c) => a + (at - k) * (ANCHORS[k + 1][c] - a)) as Rgb;
});

/** Colors of photo numbers: hues by the golden angle, so that neighbors differ. */
export const PALETTE: Rgb[] = Array.from({ length: 256 }, (_, i) => {
  const color = new THREE.Color().setHSL((i * 0.61803) % 1, 0.5, i % 2 ? 0.62 : 0.48);
  const hex = color.getHex();
  return [hex >> 16, (hex >> 8) & 255, hex & 255];
});

export const css = (rgb: Rgb) => `rgb(${rgb.map(Math.round).join(" ")})`;

export function rampTexture(colors: Rgb[], nearest = false): THREE.DataTexture {
  const data = new Uint8Array(colors.flatMap((rgb) => [...rgb, 255]));
  const texture = new THREE.DataTexture(data, colors.length, 1);
  const filter = nearest ? THREE.NearestFilter : THREE.LinearFilter;
  texture.magFilter = texture.minFilter = filter;
  texture.needsUpdate = true;
  return texture;
}

// The model on the graphics card: full, light (while moving) and textured, under one shader.

import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import type { Pack } from "./api.ts";
import type { Vec3 } from "./lens.ts";
import { PALETTE, RAMP, rampTexture } from "./ramps.ts";
import fragmentShader from "./surface.frag.glsl";
import vertexShader from "./surface.vert.glsl";
import type { Sample } from "./lightmath.ts";
import { frontOf } from "./upright.ts";

export type Layer = "color" | "photographed" | "mean" | "texture" | "base" | "relit" | "roughness" | "metallic" | "confidence" | "shaded" | "normals" | "ao" | "coverage" | "source" | "weights";

/** A picture of depths as the sun sees the model. */
export interface Shadow {
  depths: THREE.Texture;
  /** From the scene's frame to the picture's: 0..1 across, up and in depth. */
  matrix: THREE.Matrix4;
}

/** Light of layer "relit". sky: nine spherical harmonics of irradiance; tone: a number of TONES. */
export interface Relit {
  sky: THREE.Vector3[];
  toSun: THREE.Vector3;
  sunlight: THREE.Vector3;
  metered: number;
  tone: number;
  shadow: Shadow | null;
  /** What mirrors show, over `mirrorUnit`; 0 where the sky is dark. */
  mirror: THREE.DataArrayTexture | null;
  mirrorUnit: number;
  skyFromScan: THREE.Matrix3;
}

/** Layers that the lit texture shows where there is one, and by which branch. */
const LIT_MODES: Partial<Record<Layer, number>> = { base: 0, relit: 6, normals: 2, roughness: 9, metallic: 10 };

/** Which branch of surface.frag.glsl shows a layer. */
const MODES: Record<Layer, number> = {
  color: 0, photographed: 8, mean: 0, texture: 0, base: 0, relit: 6, roughness: 7, metallic: 7, confidence: 7, shaded: 1, normals: 2, ao: 3, source: 4, coverage: 5, weights: 5,
};

export class Surface {
  readonly group = new THREE.Group();
  center = new THREE.Vector3();
  radius = 1;
  faces = 0;
  /** The side that most of the surface faces, null for one that faces all sides. */
  front: Vec3 | null = null;
  layer: Layer = "shaded";
  private full: THREE.Mesh | null = null;
  private light: THREE.Mesh | null = null;
  private textured: THREE.Group | null = null;
  private nearest: Uint32Array | null = null;
  private readonly uniforms = surfaceUniforms();
  private readonly material = surfaceMaterial(this.uniforms);

  /** Show another model: the full mesh, or a light one that stands for it until that is there. */
  setFirst(pack: Pack): void {
    this.full = this.gone(this.full);
    this.light = this.gone(this.light);
    this.center.fromArray(pack.facts.center as number[]);
    if (pack.arrays.vertex_of_light) this.setLight(pack);
    else this.setFull(pack);
    const sphere = this.atRest!.geometry.boundingSphere!;
    this.radius = Math.max(sphere.radius, 1e-9);
    this.uniforms.radius.value = this.radius;
    this.faces = pack.facts.of_faces as number;
    this.front = frontOf(pack.arrays.positions, pack.arrays.faces);
    this.setMoving(false);
  }

  /** Show the full mesh. */
  setFull(pack: Pack): void {
    this.full = this.replace(this.full, meshOf(pack, this.material));
    this.show();
  }

  /** Have a simplified mesh for while the view moves. */
  setLight(pack: Pack): void {
    this.light = this.replace(this.light, meshOf(pack, this.material));
    this.nearest = pack.arrays.vertex_of_light as Uint32Array;
    for (const [name, size] of Object.entries(SIZES)) {
      if (this.full) this.copyToLight(name, this.full.geometry.attributes[name].array as Uint8Array | Float32Array, size);
    }
    this.lightHasColors = false;
    this.show();
  }

  /** What is shown at rest, but for a texture. */
  private get atRest(): THREE.Mesh | null {
    return this.full ?? this.light;
  }

  /** Whether the full mesh is there. */
  get whole(): boolean {
    return this.full !== null;
  }

  /** Faces of what is shown at rest. */
  get shownFaces(): number {
    return this.whole || !this.light ? this.faces : this.light.geometry.index!.count / 3;
  }

  /** Colors of the light mesh that stands for the textured one; layer "color" has its own. */
  setLightColors(rgba: Uint8Array): void {
    this.light?.geometry.setAttribute("rgba", new THREE.BufferAttribute(rgba, 4, true));
    this.lightHasColors = this.light !== null;
  }

  private lightHasColors = false;

  get hasLight(): boolean {
    return this.light !== null;
  }

  setColors(rgba: Uint8Array): void {
    this.lightHasColors = false;
    this.setAttribute("rgba", rgba, 4);
  }

  /** Roughness and metallic of the vertices, each 0..255. */
  setGloss(gloss: Uint8Array): void {
    this.setAttribute("gloss", gloss, 2);
  }

  /** The colors as photographed, beside those of layer "base". */
  setShot(rgba: Uint8Array): void {
    this.setAttribute("shot", rgba, 4);
  }

  /** Values of a scalar layer; `span` is the value at the end of the color ramp. */
  setValues(values: Float32Array, span: number): void {
    this.setAttribute("value", values, 1);
    this.uniforms.span.value = span;
  }

  /** lit: it is that of the surface itself, with base colors. */
  async loadTextured(url: string, lit: boolean): Promise<void> {
    const loaded = await new GLTFLoader().loadAsync(url);
    this.lit = lit;
    this.textured?.removeFromParent();
    this.textured = new THREE.Group();
    this.textured.position.copy(this.center).negate();
    this.textured.add(loaded.scene);
    inScanFrame(loaded.scene);
    loaded.scene.traverse((node) => {
      if (node instanceof THREE.Mesh) node.material = this.modelMaterial(node);
    });
    this.group.add(this.textured);
    this.show();
  }

  get hasTextured(): boolean {
    return this.textured !== null;
  }

  private lit = false;

  /** Whether the texture shows a layer better than the vertices do. */
  private byTexture(layer: Layer): boolean {
    return this.textured !== null && (layer === "texture" || (this.lit && layer in LIT_MODES));
  }

  setLayer(layer: Layer): void {
    this.layer = layer;
    this.uniforms.mode.value = this.byTexture(layer) ? (LIT_MODES[layer] ?? MODES[layer]) : MODES[layer];
    this.uniforms.ramp.value = layer === "source" ? PALETTE_TEXTURE : RAMP_TEXTURE;
    if (layer !== "texture") setRelit(this.material, layer === "relit" || layer === "photographed");
    this.show();
  }

  setExposure(stops: number): void {
    this.uniforms.exposure.value = 2 ** stops;
  }

  /** Direction to the light, view axes: x right, y up, z to the viewer. */
  setLightDirection(x: number, y: number): void {
    const z = Math.sqrt(Math.max(0, 1 - x * x - y * y));
    this.uniforms.light.value.set(x, y, z).normalize();
  }

  setRoughness(value: number): void {
    this.uniforms.roughness.value = value;
  }

  /** The light of layer "relit". */
  setRelight(light: Relit): void {
    const { uniforms } = this;
    uniforms.sky.value = light.sky;
    uniforms.toSun.value.copy(light.toSun);
    uniforms.sunlight.value.copy(light.sunlight);
    uniforms.metered.value = light.metered;
    uniforms.tone.value = light.tone;
    uniforms.shadowed.value = light.shadow !== null;
    if (light.shadow) uniforms.depths.value = light.shadow.depths;
    if (light.shadow) uniforms.shadowMatrix.value.copy(light.shadow.matrix);
    if (light.mirror) uniforms.mirror.value = light.mirror;
    uniforms.mirrorUnit.value = light.mirror ? light.mirrorUnit : 0;
    uniforms.skyFromScan.value.copy(light.skyFromScan);
  }

  /** Some of the vertices that have a color: linear base colors, and normals. */
  sample(count: number): Sample {
    const { rgba, normal } = this.atRest!.geometry.attributes;
    const step = Math.max(1, Math.floor(rgba.count / count));
    const base: number[] = [], normals: number[] = [];
    for (let i = 0; i < rgba.count; i += step) {
      if (rgba.getW(i) < 0.5) continue;
      base.push(linear(rgba.getX(i)), linear(rgba.getY(i)), linear(rgba.getZ(i)));
      normals.push(normal.getX(i), normal.getY(i), normal.getZ(i));
    }
    return { base: Float32Array.from(base), normals: Float32Array.from(normals) };
  }

  /** Use the light mesh, if there is one, or the full one. */
  setMoving(moving: boolean): void {
    this.moving = moving;
    this.show();
  }

  private moving = false;

  private show(): void {
    const textured = this.byTexture(this.layer);
    const spares = this.moving && (!textured || (this.layer === "texture" && this.lightHasColors));
    const light = this.light !== null && (spares || (!this.whole && !textured));
    if (this.full) this.full.visible = !light && !textured;
    if (this.light) this.light.visible = light;
    if (this.textured) this.textured.visible = textured && !light;
  }

  /** For a part of a glb: with a texture, with vertex colors, or with neither. */
  private modelMaterial(part: THREE.Mesh): THREE.ShaderMaterial {
    const first = Array.isArray(part.material) ? part.material[0] : part.material;
    const { map = null, normalMap = null, metalnessMap = null } = first as THREE.MeshStandardMaterial;
    const material = surfaceMaterial({ ...this.uniforms, map: { value: map }, bump: { value: normalMap }, orm: { value: metalnessMap } });
    const colored = "color" in part.geometry.attributes;
    if (map && normalMap && "tangent" in part.geometry.attributes) material.defines.USE_BUMP = "";
    if (map && metalnessMap) material.defines.USE_GLOSS = "";
    material.defines[map ? "USE_MAP" : colored ? "LINEAR_COLOR" : "UNSEEN"] = "";
    if (map) map.anisotropy = 2;
    setRelit(material, this.lit);
    return material;
  }

  private replace(old: THREE.Mesh | null, made: THREE.Mesh): THREE.Mesh {
    this.gone(old);
    this.group.add(made);
    return made;
  }

  private gone(old: THREE.Mesh | null): null {
    old?.removeFromParent();
    old?.geometry.dispose();
    return null;
  }

  private setAttribute(name: keyof typeof SIZES, data: Uint8Array | Float32Array, size: number): void {
    this.full?.geometry.setAttribute(name, new THREE.BufferAttribute(data, size, size > 1));
    if (this.light) this.copyToLight(name, data, size);
  }

  private copyToLight(name: string, data: Uint8Array | Float32Array, size: number): void {
    const nearest = this.nearest!;
    const Type = data.constructor as new (n: number) => typeof data;
    const out = new Type(nearest.length * size);
    for (let i = 0; i < nearest.length; i++) {
      for (let k = 0; k < size; k++) out[i * size + k] = data[nearest[i] * size + k];
    }
    this.light!.geometry.setAttribute(name, new THREE.BufferAttribute(out, size, size > 1));
  }
}

/** Whether a material can show the layers about reflectance; others are drawn quicker without. */
function setRelit(material: THREE.ShaderMaterial, on: boolean): void {
  if ("RELIT" in material.defines === on) return;
  if (on) material.defines.RELIT = "";
  else delete material.defines.RELIT;
  material.needsUpdate = true;
}

/** Undo the turn and scale by which a glb stands upright: here it stands in the scan's frame. */
function inScanFrame(scene: THREE.Object3D): void {
  const upright = scene.getObjectByName("upright");
  upright?.quaternion.identity();
  upright?.scale.setScalar(1);
}

/** Numbers of each attribute of the vertices that changes; those of bytes stand for 0..1. */
const SIZES = { rgba: 4, value: 1, gloss: 2, shot: 4 };

const linear = (c: number) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);

/** Stands for the mirrors of a sky where there is none. */
const DARK = new THREE.DataArrayTexture(new Uint8Array(4), 1, 1, 1);
DARK.needsUpdate = true;

const RAMP_TEXTURE = rampTexture(RAMP);
const PALETTE_TEXTURE = rampTexture(PALETTE, true);

function surfaceUniforms() {
  return {
    mode: { value: MODES.shaded },
    exposure: { value: 1 },
    light: { value: new THREE.Vector3(-0.35, 0.45, 0.82).normalize() },
    roughness: { value: 0.55 },
    span: { value: 1 },
    ramp: { value: RAMP_TEXTURE },
    sky: { value: Array.from({ length: 9 }, () => new THREE.Vector3()) },
    toSun: { value: new THREE.Vector3(0, 0, 1) },
    sunlight: { value: new THREE.Vector3() },
    metered: { value: 1 },
    tone: { value: 0 },
    shadowed: { value: false },
    depths: { value: RAMP_TEXTURE as THREE.Texture },
    shadowMatrix: { value: new THREE.Matrix4() },
    radius: { value: 1 },
    mirror: { value: DARK as THREE.DataArrayTexture },
    mirrorUnit: { value: 0 },
    skyFromScan: { value: new THREE.Matrix3() },
  };
}

function surfaceMaterial(uniforms: Record<string, THREE.IUniform>): THREE.ShaderMaterial {
  return new THREE.ShaderMaterial({
    uniforms,
    vertexShader,
    fragmentShader,
    glslVersion: THREE.GLSL3,
    side: THREE.DoubleSide,
    toneMapped: false,
  });
}

function meshOf(pack: Pack, material: THREE.Material): THREE.Mesh {
  const { positions, normals, faces } = pack.arrays;
  const geometry = new THREE.BufferGeometry();
  const count = positions.length / 3;
  geometry.setIndex(new THREE.BufferAttribute(faces, 1));
  geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
  geometry.setAttribute("normal", normalAttribute(normals as Int8Array));
  geometry.setAttribute("rgba", new THREE.BufferAttribute(new Uint8Array(count * 4), 4, true));
  geometry.setAttribute("value", new THREE.BufferAttribute(new Float32Array(count).fill(-1), 1));
  const matte = new Uint8Array(2 * count);
  for (let i = 0; i < matte.length; i += 2) matte[i] = 255;
  geometry.setAttribute("gloss", new THREE.BufferAttribute(matte, 2, true));
  geometry.setAttribute("shot", new THREE.BufferAttribute(new Uint8Array(count * 4), 4, true));
  geometry.computeBoundingSphere();
  return new THREE.Mesh(geometry, material);
}

/** Three of each four bytes: the graphics card wants attributes at multiples of four bytes. */
function normalAttribute(normals: Int8Array): THREE.InterleavedBufferAttribute {
  return new THREE.InterleavedBufferAttribute(new THREE.InterleavedBuffer(normals, 4), 3, 0, true);
}

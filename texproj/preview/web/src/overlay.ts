// A photo laid over the view from its own camera.

import * as THREE from "three";
import { imageUrl } from "./api.ts";
import type { Camera, Sides } from "./lens.ts";
import { padded } from "./lens.ts";
import fragmentShader from "./overlay.frag.glsl";
import vertexShader from "./overlay.vert.glsl";

export class PhotoOverlay {
  readonly mesh: THREE.Mesh;
  private readonly uniforms = {
    sides: { value: new THREE.Vector4() },
    focal: { value: new THREE.Vector2(1, 1) },
    principal: { value: new THREE.Vector2() },
    size: { value: new THREE.Vector2(1, 1) },
    dist: { value: padded([]) },
    fisheye: { value: false },
    maxRadius2: { value: Infinity },
    opacity: { value: 1 },
    wipe: { value: 1 },
    exposure: { value: 1 },
    photo: { value: null as THREE.Texture | null },
  };

  constructor() {
    const geometry = new THREE.BufferGeometry();
    const corners = new Float32Array([-1, -1, 0, 3, -1, 0, -1, 3, 0]);
    geometry.setAttribute("position", new THREE.BufferAttribute(corners, 3));
    const material = new THREE.ShaderMaterial({
      uniforms: this.uniforms,
      vertexShader,
      fragmentShader,
      glslVersion: THREE.GLSL3,
      transparent: true,
      depthTest: false,
      depthWrite: false,
      toneMapped: false,
    });
    this.mesh = new THREE.Mesh(geometry, material);
    this.mesh.frustumCulled = false;
    this.mesh.renderOrder = 10;
    this.mesh.visible = false;
  }

  private wanted = "";

  /** Bring in a photo at full size; a small one while it loads. arrived: called for either. */
  async load(name: string, arrived: (size: number) => void): Promise<void> {
    if (this.wanted === name) return;
    this.wanted = name;
    this.setPhoto(null);
    for (const size of [1600, 8192] as const) {
      const texture = await loadTexture(imageUrl(name, size)).catch(() => null);
      if (this.wanted !== name || !texture) return;
      this.setPhoto(texture);
      arrived(size);
    }
  }

  private setPhoto(texture: THREE.Texture | null): void {
    this.uniforms.photo.value?.dispose();
    this.uniforms.photo.value = texture;
  }

  setCamera(camera: Camera): void {
    this.uniforms.focal.value.fromArray(camera.f);
    this.uniforms.principal.value.fromArray(camera.c);
    this.uniforms.size.value.set(camera.width, camera.height);
    this.uniforms.dist.value = padded(camera.dist);
    this.uniforms.fisheye.value = camera.model === "fisheye";
    this.uniforms.maxRadius2.value = camera.max_radius === null ? 1e30 : camera.max_radius ** 2;
  }

  setSides(sides: Sides): void {
    this.uniforms.sides.value.set(sides.left, sides.right, sides.bottom, sides.top);
  }

  setLook(opacity: number, wipe: number, stops: number): void {
    this.uniforms.opacity.value = opacity;
    this.uniforms.wipe.value = wipe;
    this.uniforms.exposure.value = 2 ** stops;
  }

  /** Whether the photo is drawn; it never is before its picture arrived. */
  show(visible: boolean): void {
    this.mesh.visible = visible && this.uniforms.photo.value !== null;
  }
}

/** A photo as a texture in linear light, first row on top. */
export async function loadTexture(url: string): Promise<THREE.Texture> {
  const loader = new THREE.ImageBitmapLoader();
  const image = await loader.loadAsync(url);
  const texture = new THREE.Texture(image);
  texture.colorSpace = THREE.SRGBColorSpace;
  texture.flipY = false;
  texture.generateMipmaps = true;
  texture.minFilter = THREE.LinearMipmapLinearFilter;
  texture.anisotropy = 4;
  texture.needsUpdate = true;
  return texture;
}

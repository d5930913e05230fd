// Where the sun's light does not come: a picture of depths as the sun sees the model.

import * as THREE from "three";
import type { Shadow } from "./surface.ts";
import type { Viewport } from "./viewport.ts";

const SIZE = 2048;

export class SunShadow {
  private readonly target = new THREE.WebGLRenderTarget(SIZE, SIZE, { depthTexture: new THREE.DepthTexture(SIZE, SIZE, THREE.UnsignedIntType) });
  private readonly camera = new THREE.OrthographicCamera();
  private readonly material = new THREE.MeshBasicMaterial({ side: THREE.DoubleSide, colorWrite: false });
  private key = "";
  private readonly shadow: Shadow = { depths: this.target.depthTexture!, matrix: new THREE.Matrix4() };

  /** The shadow of the model in the sun's light; drawn again where the sun or the model is another. */
  cast(viewport: Viewport, toSun: THREE.Vector3): Shadow {
    const { renderer, scene, surface } = viewport;
    const key = `${toSun.toArray().map((x) => x.toFixed(4))} ${surface.faces} ${surface.radius} ${surface.center.toArray()}`;
    if (key === this.key) return this.shadow;
    this.key = key;
    const r = surface.radius * 1.02;
    Object.assign(this.camera, { left: -r, right: r, top: r, bottom: -r, near: 0, far: 4 * r });
    this.camera.position.copy(toSun).multiplyScalar(2 * r);
    this.camera.up.set(0, 0, 1);
    if (Math.abs(toSun.z) > 0.99) this.camera.up.set(0, 1, 0);
    this.camera.lookAt(0, 0, 0);
    this.camera.updateProjectionMatrix();
    this.camera.updateMatrixWorld();
    const hidden = scene.children.filter((child) => child !== surface.group && child.visible);
    for (const child of hidden) child.visible = false;
    scene.overrideMaterial = this.material;
    renderer.setRenderTarget(this.target);
    renderer.render(scene, this.camera);
    renderer.setRenderTarget(null);
    scene.overrideMaterial = null;
    for (const child of hidden) child.visible = true;
    const half = new THREE.Matrix4().makeTranslation(0.5, 0.5, 0.5).multiply(new THREE.Matrix4().makeScale(0.5, 0.5, 0.5));
    this.shadow.matrix.copy(half).multiply(this.camera.projectionMatrix).multiply(this.camera.matrixWorldInverse);
    return this.shadow;
  }
}

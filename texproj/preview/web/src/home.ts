// Where the model is seen from at first, and which way it stands.

import * as THREE from "three";
import type { Facts, PhotoFacts } from "./api.ts";
import { center } from "./lens.ts";
import type { Axis } from "./upright.ts";
import { axisOf, guessedUp, vectorOf } from "./upright.ts";
import type { Viewport } from "./viewport.ts";

export class Home {
  /** The upward axis that a person chose. */
  private chosen: Axis | null = null;

  constructor(private readonly viewport: Viewport) {}

  /** Look from where the photos were taken, with their upper side up; else at the front. */
  go(facts: Facts, viewable: PhotoFacts[]): void {
    this.chosen = facts.up;
    const { center: middle, radius, front } = this.viewport.surface;
    const cameras = viewable.map((photo) => photo.camera!);
    const eyes = cameras.map((camera) => new THREE.Vector3(...center(camera)).sub(middle));
    const up = this.firstUp(cameras);
    const reach = Math.max(radius, ...eyes.map((eye) => eye.length()));
    this.viewport.setUp(up, reach);
    const best = mostCentral(eyes);
    if (best >= 0) this.viewport.lookAlong(eyes[best], new THREE.Vector3(...cameras[best].R[2]));
    else if (front) this.viewport.lookFrom(new THREE.Vector3(...front).addScaledVector(up, 0.15));
    else this.viewport.lookFrom(new THREE.Vector3(1, -1, 0.6).applyQuaternion(fromZ(up)));
  }

  /** Up as a person chose it, else as the photos were held, else as the surface stands. */
  private firstUp(cameras: PhotoFacts["camera"][]): THREE.Vector3 {
    if (this.chosen) return new THREE.Vector3(...vectorOf(this.chosen));
    const up = new THREE.Vector3();
    for (const camera of cameras) up.sub(new THREE.Vector3(...camera!.R[1]));
    if (up.length() > 0.1) return up.normalize();
    return new THREE.Vector3(...vectorOf(guessedUp(this.viewport.surface.front)));
  }

  /** Stand the model on another side. */
  setUp(axis: Axis): void {
    this.chosen = axis;
    this.viewport.turnUp(new THREE.Vector3(...vectorOf(axis)));
  }

  /** The axis that is up now. */
  get up(): Axis {
    return axisOf(this.viewport.camera.up.toArray() as [number, number, number]);
  }
}

/** The index of the eye nearest to the middle of all; -1 for none. */
function mostCentral(eyes: THREE.Vector3[]): number {
  const mean = new THREE.Vector3();
  for (const eye of eyes) mean.addScaledVector(eye, 1 / eyes.length);
  const distances = eyes.map((eye) => eye.distanceTo(mean));
  return distances.indexOf(Math.min(...distances));
}

function fromZ(up: THREE.Vector3): THREE.Quaternion {
  return new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(0, 0, 1), up);
}

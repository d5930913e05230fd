// What can be chosen of the light in which the surface is shown.

/** Tone curves by the number that surface.frag.glsl has for each. */
export const TONES = ["none", "reinhard", "filmic", "aces"] as const;
export const SKIES = { overcast: "Overcast", photographed: "As in the photos", picture: "A picture", none: "None" } as const;
export type Sky = keyof typeof SKIES;

/** heading, height: degrees, as seen by who looks at the front: from behind the viewer to the right, above level. */
export interface Choice {
  sun: boolean;
  heading: number;
  height: number;
  kelvin: number;
  sky: Sky;
  tone: (typeof TONES)[number];
  /** Beside what was photographed. */
  split: boolean;
}

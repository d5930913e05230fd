// The right-hand panel of the result view: layers, light, exposure, photo over model.

import type { PhotoFacts } from "./api.ts";
import { check, el, exposureSlider, section, slider } from "./dom.ts";
import type { Layer } from "./surface.ts";
import type { Axis } from "./upright.ts";
import { AXES } from "./upright.ts";

export interface Look {
  layer: Layer;
  factor: string;
  exposure: number;
  roughness: number;
  light: [number, number];
  frustums: boolean;
  opacity: number;
  wipe: number;
}

/** appearance: shown only where the light was taken out. */
export const LAYERS: { layer: Layer; name: string; what: string; appearance?: boolean }[] = [
  { layer: "color", name: "Color", what: "The model colored from the photos, on its vertices" },
  { layer: "texture", name: "Texture", what: "The model with its texture" },
  { layer: "shaded", name: "Plain", what: "Bare shape under a movable light" },
  { layer: "normals", name: "Normals", what: "Direction of the surface as color" },
  { layer: "ao", name: "Occlusion", what: "How open the surface is to its surroundings" },
  { layer: "coverage", name: "Coverage", what: "How many photos see the surface" },
  { layer: "source", name: "Source", what: "Which photo counts most" },
  { layer: "weights", name: "Weights", what: "How much the chosen photo counts" },
  { layer: "mean", name: "Mean", what: "The plain mean of all photos: what is off shows as doubled edges" },
  { layer: "base", name: "Base color", what: "The surface itself, without the light of the photos", appearance: true },
  { layer: "relit", name: "Relit", what: "The surface in another light", appearance: true },
  { layer: "roughness", name: "Roughness", what: "How wide highlights are; natural light tells nothing of it", appearance: true },
  { layer: "metallic", name: "Metallic", what: "Where the surface is a metal", appearance: true },
  { layer: "confidence", name: "Confidence", what: "How sure the base color is", appearance: true },
];

/** What a photo's weight is made of; the first is all of it but what depends on other photos. */
export const FACTORS: { factor: string; name: string; what: string }[] = [
  { factor: "weights", name: "All", what: "How much the chosen photo counts, before it is compared with others" },
  { factor: "angle", name: "Angle", what: "Turned towards the camera" },
  { factor: "density", name: "Density", what: "Pixels on the surface" },
  { factor: "border", name: "Border", what: "Away from the picture's edge" },
  { factor: "silhouette", name: "Silhouette", what: "Away from depth discontinuities" },
  { factor: "mask", name: "Mask", what: "Away from what is masked" },
  { factor: "exposure", name: "Exposure", what: "Neither clipped nor black" },
  { factor: "focus", name: "Focus", what: "As sharp as the other photos" },
  { factor: "highlight", name: "Highlight", what: "Without a highlight" },
  { factor: "consistency", name: "Consistency", what: "As all photos agree" },
];

export interface PanelActions {
  change(part: Partial<Look>): void;
  exitPhoto(): void;
  pick(photo: PhotoFacts): void;
  setUp(axis: Axis): void;
  roll(degrees: number): void;
  mask(photo: PhotoFacts): void;
  viewNamed(name: string): void;
}

export function viewPanel(
  look: Look, wanted: Layer, up: Axis, available: Set<Layer>, photo: PhotoFacts | null, inPhoto: boolean, seenIn: string[], act: PanelActions,
): HTMLElement[] {
  const parts = [layerSection(look, wanted, available, act), toneSection(look, act)];
  if (!inPhoto) parts.push(uprightSection(up, act));
  if (look.layer === "shaded") parts.push(lightSection(look, act));
  if (photo) parts.unshift(photoSection(look, photo, inPhoto, seenIn, act));
  return parts;
}

/** That a large mesh is shown with fewer faces, and how to have them all. */
export function wholeSection(shown: number, faces: number, loading: boolean, load: () => void): HTMLElement {
  const count = (n: number) => n.toLocaleString("en");
  const words = loading ? "Loading\u2026" : `Show all ${count(faces)}`;
  const button = el("button", { type: "button", id: "show-whole", onclick: load }, words);
  button.disabled = loading;
  const hint = `${count(shown)} faces stand for those of the mesh. Picked points and files are exact.`;
  return section("Faces", el("p", { class: "hint" }, hint), el("div", { class: "button-row" }, button));
}

function layerSection(look: Look, wanted: Layer, available: Set<Layer>, act: PanelActions): HTMLElement {
  const buttons = LAYERS.filter((entry) => !entry.appearance || available.has(entry.layer)).map(({ layer, name, what }) => {
    const button = el(
      "button",
      {
        type: "button", role: "radio", title: what, "data-layer": layer, "aria-checked": wanted === layer,
        "aria-busy": wanted === layer && look.layer !== layer,
        onclick: () => act.change({ layer }),
      },
      name,
    );
    button.disabled = !available.has(layer);
    return button;
  });
  const factor = FACTORS.find((entry) => entry.factor === look.factor)!;
  const weights = look.layer === "weights";
  const asked = LAYERS.find((entry) => entry.layer === wanted)!.what;
  const what = wanted !== look.layer ? `${asked}: loading\u2026` : weights ? factor.what : asked;
  return section(
    "Show",
    el("div", { class: "choices", role: "radiogroup", "aria-label": "Layer" }, ...buttons),
    ...(weights ? [factorChoice(look, act)] : []),
    el("p", { class: "hint" }, available.size > 1 || look.layer !== "shaded" ? what : "No result yet."),
  );
}

function factorChoice(look: Look, act: PanelActions): HTMLElement {
  const options = FACTORS.map(({ factor, name }) =>
    el("option", { value: factor, selected: factor === look.factor }, name),
  );
  const choice = el("select", { "aria-label": "Factor", onchange: () => act.change({ factor: choice.value }) }, ...options);
  return el("label", { class: "factor" }, "Factor ", choice);
}

function toneSection(look: Look, act: PanelActions): HTMLElement {
  return section(
    "Picture",
    exposureSlider(look.exposure, (exposure) => act.change({ exposure })),
    check("Cameras", look.frustums, (frustums) => act.change({ frustums })),
  );
}

function uprightSection(up: Axis, act: PanelActions): HTMLElement {
  const axes = AXES.map((axis) =>
    el("button", {
      type: "button", role: "radio", "data-up": axis, "aria-checked": axis === up, onclick: () => act.setUp(axis),
    }, axis.replace("-", "\u2212")),
  );
  const roll = (words: string, degrees: number) =>
    el("button", { type: "button", title: `Roll the view by ${degrees} degrees`, onclick: () => act.roll(degrees) }, words);
  return section(
    "Up axis",
    el("div", { class: "axes", role: "radiogroup", "aria-label": "Up axis" }, ...axes),
    el("div", { class: "button-row" }, roll("\u21ba 15\u00b0", -15), roll("Turn over", 180), roll("\u21bb 15\u00b0", 15)),
  );
}

function lightSection(look: Look, act: PanelActions): HTMLElement {
  const percent = (value: number) => `${Math.round(value * 100)} %`;
  const rough = slider(
    "Roughness", { min: 0.15, max: 1, step: 0.01, value: look.roughness }, percent, (roughness) => act.change({ roughness }),
  );
  return section("Light", el("div", { class: "light-row" }, lightPad(look, act), rough));
}

function lightPad(look: Look, act: PanelActions): HTMLElement {
  const dot = el("i");
  const pad = el("div", { id: "light-pad", tabindex: 0, role: "application", "aria-label": "Direction of the light; arrow keys move it" }, dot);
  let [x, y] = look.light;
  const put = (nx: number, ny: number) => {
    const length = Math.max(Math.hypot(nx, ny) / 0.97, 1);
    [x, y] = [nx / length, ny / length];
    dot.style.left = `${50 + x * 46}%`;
    dot.style.top = `${50 - y * 46}%`;
    act.change({ light: [x, y] });
  };
  const follow = (event: PointerEvent) => {
    const box = pad.getBoundingClientRect();
    put(((event.clientX - box.left) / box.width) * 2 - 1, 1 - ((event.clientY - box.top) / box.height) * 2);
  };
  pad.addEventListener("pointerdown", (event) => {
    pad.setPointerCapture(event.pointerId);
    follow(event);
  });
  pad.addEventListener("pointermove", (event) => {
    if (event.buttons) follow(event);
  });
  pad.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: [-0.08, 0], ArrowRight: [0.08, 0], ArrowUp: [0, 0.08], ArrowDown: [0, -0.08] }[event.key];
    if (!step) return;
    event.preventDefault();
    event.stopPropagation();
    put(x + step[0], y + step[1]);
  });
  dot.style.left = `${50 + x * 46}%`;
  dot.style.top = `${50 - y * 46}%`;
  return pad;
}

function photoSection(look: Look, photo: PhotoFacts, inPhoto: boolean, seenIn: string[], act: PanelActions): HTMLElement {
  const percent = (value: number) => `${Math.round(value * 100)} %`;
  const pick = el("button", { type: "button", onclick: () => act.pick(photo) }, "Pick points");
  const mask = el("button", { type: "button", class: "mask", onclick: () => act.mask(photo) }, photo.mask ? "Edit the mask" : "Paint a mask");
  const others = seenIn.length ? [seenAlso(seenIn, act)] : [];
  if (photo.status === "broken" || photo.status === "excluded") return section(photo.name, facts(photo));
  if (!inPhoto) return section(photo.name, facts(photo), ...others, el("div", { class: "button-row" }, pick, mask));
  const leave = el("button", { type: "button", onclick: () => act.exitPhoto() }, "Leave photo");
  return section(
    photo.name,
    facts(photo),
    slider("Photo over model", { min: 0, max: 1, step: 0.01, value: look.opacity }, percent, (opacity) => act.change({ opacity })),
    slider("Wipe", { min: 0, max: 1, step: 0.001, value: look.wipe }, percent, (wipe) => act.change({ wipe })),
    el("p", { class: "hint" }, el("kbd", {}, "Space"), " blinks photo and model"),
    ...others,
    el("div", { class: "button-row" }, leave, pick, mask),
  );
}

/** The photos that show the same, most of it first. */
function seenAlso(names: string[], act: PanelActions): HTMLElement {
  const links = names.map((name) => el("button", { type: "button", class: "quiet", onclick: () => act.viewNamed(name) }, name));
  return el("div", { class: "seen-also" }, el("span", { class: "hint" }, "Seen also in "), ...links);
}

function facts(photo: PhotoFacts): HTMLElement {
  const rows: [string, string][] = [];
  if (photo.width) rows.push(["Size", `${photo.width} \u00d7 ${photo.height}`]);
  if (photo.camera) rows.push(["Focal length", `${photo.camera.f[0].toFixed(1)} px`]);
  const error = photo.expected_error_px;
  if (error != null) rows.push(["Expected error", `${error.toFixed(2)} px`]);
  const median = photo.quality?.median_residual_px;
  if (typeof median === "number") rows.push(["Median residual", `${median.toFixed(2)} px`]);
  if (photo.picks) rows.push(["Picks", String(photo.picks)]);
  return el("dl", { class: "facts-table" }, ...rows.flatMap(([k, v]) => [el("dt", {}, k), el("dd", {}, v)]));
}

// The right-hand panel while a mask is painted.

import { el, exposureSlider, section, slider } from "./dom.ts";
import type { Host } from "./host.ts";
import type { MaskMode, Tool } from "./maskmode.ts";

const WIDEST_PX = 400;
const MOST_GROWTH_PX = 100;

export function maskPanel(mode: MaskMode, app: Host): HTMLElement[] {
  const say = (px: number) => `${Math.round(px)} px`;
  const file = mode.facts?.file;
  const told = file ? `Saved as masks/${file}.` : "No mask yet: the whole photo is used.";
  return [
    section(
      `Mask of ${mode.photo?.name ?? ""}`,
      el("p", { class: "hint" }, "Red is never used: people, sky, whatever is not the object. Drag to paint; the wheel zooms, the right button moves the photo."),
      el("div", { class: "choices", role: "radiogroup", "aria-label": "Brush" }, tool(mode, "paint", "Paint"), tool(mode, "erase", "Erase")),
      slider("Brush radius", { min: 1, max: Math.max(WIDEST_PX, mode.radius), step: 1, value: mode.radius }, say, (radius) => mode.setRadius(radius)),
      exposureSlider(app.look.exposure, (exposure) => app.change({ exposure })),
    ),
    section(
      "Whole mask",
      slider("By", { min: 1, max: MOST_GROWTH_PX, step: 1, value: mode.growth }, say, (growth) => (mode.growth = growth)),
      el("div", { class: "button-row" }, button("Grow", () => mode.grow(mode.growth)), button("Shrink", () => mode.grow(-mode.growth))),
      el("div", { class: "button-row" }, undo(mode), button("Clear", () => mode.clear())),
      el("p", { class: "hint", id: "mask-saved", "data-state": mode.busy ? "saving" : "saved" }, mode.busy ? "Saving\u2026" : told),
      el("div", { class: "button-row" }, button("Done", () => mode.leave(), "leave-mask")),
    ),
  ];
}

function tool(mode: MaskMode, name: Tool, words: string): HTMLElement {
  return el("button", { type: "button", role: "radio", "aria-checked": mode.tool === name, onclick: () => mode.choose(name) }, words);
}

function undo(mode: MaskMode): HTMLElement {
  const made = button("Undo", () => mode.undo(), "mask-undo");
  made.disabled = !mode.facts?.undo;
  return made;
}

function button(words: string, act: () => void, id = ""): HTMLButtonElement {
  return el("button", { type: "button", id: id || false, onclick: act }, words);
}

// What to do in a project of which no photo is registered: three ways, the least work first.

import type { Facts, PhotoFacts } from "./api.ts";
import { byId, el } from "./dom.ts";

export interface StartActions {
  run(): void;
  pick(photo: PhotoFacts): void;
  close(): void;
}

/** The card is shown where it helps: no camera yet, nothing at work. */
export function showStart(facts: Facts, wanted: boolean, act: StartActions): void {
  const card = byId("start");
  const usable = facts.photos.filter((photo) => photo.status !== "broken");
  const none = usable.length > 0 && !usable.some((photo) => photo.status === "registered");
  card.hidden = !wanted || !none;
  if (card.hidden) return;
  const tried = usable.some((photo) => photo.status === "failed");
  card.replaceChildren(...content(usable, tried, act));
}

function content(photos: PhotoFacts[], tried: boolean, act: StartActions): HTMLElement[] {
  const run = el("button", { type: "button", id: "start-run", class: tried ? "" : "main", onclick: () => act.run() }, "Make the model");
  const best = photoToPick(photos);
  const pick = el(
    "button", { type: "button", id: "start-pick", class: tried ? "main" : "", onclick: () => act.pick(best) }, `Pick points in ${best.name}`,
  );
  const close = el("button", { type: "button", class: "quiet", onclick: () => act.close() }, "Not now");
  return [
    el("h2", {}, tried ? "The photos could not be placed by themselves" : "Three ways to start, the least work first"),
    el("ol", {},
      way("All photos together", "No click. For photos that overlap each other by half.", run),
      way("8 points in one photo", "One that shows much of the model and overlaps others; these are then found from it.", pick),
      way("Cameras of another program", "COLMAP, Metashape, RealityScan, Meshroom and others.", el("code", {}, "texproj import DIR FILE")),
    ),
    el("div", { class: "button-row end" }, close),
  ];
}

function way(title: string, words: string, action: HTMLElement): HTMLElement {
  return el("li", {}, el("div", {}, el("b", {}, title), el("span", {}, words)), action);
}

/** The photo that has most picks already, else the middle one: photos are taken going round. */
export function photoToPick(photos: PhotoFacts[]): PhotoFacts {
  const most = photos.reduce((a, b) => (b.picks > a.picks ? b : a));
  return most.picks > 0 ? most : photos[Math.floor(photos.length / 2)];
}

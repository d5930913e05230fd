// The list of photos: how each stands, what is wrong, what to do.

import type { PhotoFacts } from "./api.ts";
import { imageUrl } from "./api.ts";
import { byId, el } from "./dom.ts";
import { css, PALETTE } from "./ramps.ts";

export interface ListActions {
  view(photo: PhotoFacts): void;
  pick(photo: PhotoFacts): void;
  choose(photo: PhotoFacts): void;
}

const ORDER: PhotoFacts["status"][] = ["broken", "failed", "none", "prior", "registered"];

/** Worst first: without a camera, then by expected error. */
export function worstFirst(photos: PhotoFacts[]): PhotoFacts[] {
  const rank = (p: PhotoFacts) => ORDER.indexOf(p.status);
  const error = (p: PhotoFacts) => p.expected_error_px ?? Infinity;
  const by = (a: number, b: number) => (a === b ? 0 : a - b);
  return [...photos].sort((a, b) => by(rank(a), rank(b)) || by(error(b), error(a)) || a.name.localeCompare(b.name));
}

export function showPhotos(photos: PhotoFacts[], chosen: string | null, colors: boolean, act: ListActions): void {
  const list = byId("photo-list");
  const focused = document.activeElement?.closest<HTMLElement>(".photo")?.dataset.photo;
  const numbers = new Map(photos.map((photo, i) => [photo.name, i]));
  const rows = worstFirst(photos).map((photo) => {
    const color = colors && photo.camera ? css(PALETTE[numbers.get(photo.name)! % 256]) : "";
    return row(photo, photo.name === chosen, color, act);
  });
  list.replaceChildren(...rows);
  if (focused) list.querySelector<HTMLElement>(`[data-photo="${CSS.escape(focused)}"]`)?.focus();
  byId("photo-count").textContent = summary(photos);
}

function summary(photos: PhotoFacts[]): string {
  const done = photos.filter((p) => p.status === "registered").length;
  return `${done} of ${photos.length} registered`;
}

function row(photo: PhotoFacts, chosen: boolean, color: string, act: ListActions): HTMLLIElement {
  const item = el(
    "li",
    {
      class: `photo ${grade(photo)}`, tabindex: 0, "data-photo": photo.name, "data-status": photo.status,
      "aria-current": chosen,
      onclick: () => act.choose(photo),
      onkeydown: (event: KeyboardEvent) => onKey(event, photo, act),
    },
    thumb(photo),
    nameOf(photo, color),
    el("div", { class: "state" }, el("span", { class: "dot" }), stateOf(photo)),
    el("div", { class: "facts" }, factsOf(photo)),
    why(photo),
  );
  if (photo.status !== "broken") item.append(buttons(photo, act));
  return item;
}

function onKey(event: KeyboardEvent, photo: PhotoFacts, act: ListActions): void {
  if (event.target !== event.currentTarget) return;
  const item = event.currentTarget as HTMLElement;
  if (event.key === "Enter") act.choose(photo);
  else if (event.key === "ArrowDown") (item.nextElementSibling as HTMLElement | null)?.focus();
  else if (event.key === "ArrowUp") (item.previousElementSibling as HTMLElement | null)?.focus();
  else return;
  event.preventDefault();
  event.stopPropagation();
}

function buttons(photo: PhotoFacts, act: ListActions): HTMLElement {
  const on = (go: (photo: PhotoFacts) => void) => (event: Event) => {
    event.stopPropagation();
    go(photo);
  };
  const view = el("button", { type: "button", onclick: on(act.view) }, "View from here");
  view.disabled = !photo.camera;
  const pick = el("button", { type: "button", class: "pick", onclick: on(act.pick) }, "Pick points");
  return el("div", { class: "row" }, view, pick);
}

function thumb(photo: PhotoFacts): HTMLElement {
  if (photo.status === "broken") return el("div", { class: "thumb" }, "unreadable");
  return el("img", { class: "thumb", src: imageUrl(photo.name, 240), alt: "", loading: "lazy" });
}

function nameOf(photo: PhotoFacts, color: string): HTMLElement {
  const name = el("div", { class: "name", title: photo.name });
  if (color) {
    const chip = el("i");
    chip.style.background = color;
    name.append(chip);
  }
  name.append(photo.name);
  return name;
}

export function grade(photo: PhotoFacts): "good" | "warn" | "bad" | "" {
  if (photo.status === "broken" || photo.status === "failed") return "bad";
  if (photo.status === "registered") return photo.weak ? "warn" : "good";
  return "";
}

function stateOf(photo: PhotoFacts): string {
  const error = photo.expected_error_px;
  if (photo.status === "registered") {
    const known = error != null ? `\u00b1 ${error.toFixed(error < 10 ? 2 : 0)} px` : "";
    return photo.weak ? `Weak, ${known}` : known ? `Good, ${known}` : "Registered";
  }
  const words = { broken: "Cannot be read", failed: "Failed", none: "Not registered", prior: "Approximate" };
  return words[photo.status];
}

const METHODS: Record<string, string> = {
  points: "from points",
  import: "imported",
  structure: "from structure",
  silhouette: "from the silhouette",
  features: "from features",
  "mutual-information": "from mutual information",
  block: "with all other photos",
};

/** How a photo's camera was found. */
export function methodWords(photo: PhotoFacts): string {
  return photo.method ? (METHODS[photo.method] ?? photo.method) : "";
}

function factsOf(photo: PhotoFacts): string {
  const parts = [];
  if (photo.method) parts.push(methodWords(photo));
  if (photo.picks) parts.push(`${photo.picks} picks`);
  if (!parts.length && photo.width) parts.push(`${photo.width} \u00d7 ${photo.height}`);
  return parts.join(" \u00b7 ");
}

function why(photo: PhotoFacts): HTMLElement {
  const box = el("div", { class: "why" });
  if (photo.picks_error) box.append(photo.picks_error);
  else if (grade(photo) !== "good" && (photo.status !== "none" || photo.picks)) {
    if (photo.reason) box.append(photo.reason);
    if (photo.advice) box.append(el("b", {}, photo.advice));
  }
  return box;
}

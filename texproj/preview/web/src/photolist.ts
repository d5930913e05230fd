// The list of photos: how each stands, what is wrong, what to do.

import type { PhotoFacts } from "./api.ts";
import { imageUrl } from "./api.ts";
import { byId, el } from "./dom.ts";
import { css, PALETTE } from "./ramps.ts";

export interface ListActions {
  view(photo: PhotoFacts): void;
  pick(photo: PhotoFacts): void;
  choose(photo: PhotoFacts): void;
  /** Leave a photo out of everything, or take it back. */
  leaveOut(photo: PhotoFacts, out: boolean): void;
}

export type Filter = "all" | "todo" | "registered" | "out";
export type Order = "worst" | "name" | "error" | "residual";

/** Which photos are listed, and in which order. */
export interface Choice {
  search: string;
  filter: Filter;
  order: Order;
}

const STATES: PhotoFacts["status"][] = ["broken", "failed", "none", "prior", "registered", "excluded"];

const by = (a: number, b: number) => (a === b ? 0 : a - b);

/** Worst first: without a camera, then by expected error. */
export function worstFirst(photos: PhotoFacts[]): PhotoFacts[] {
  const rank = (p: PhotoFacts) => STATES.indexOf(p.status);
  const error = (p: PhotoFacts) => p.expected_error_px ?? Infinity;
  return [...photos].sort((a, b) => by(rank(a), rank(b)) || by(error(b), error(a)) || byName(a, b));
}

const byName = (a: PhotoFacts, b: PhotoFacts) => a.name.localeCompare(b.name, "en", { numeric: true });

const FILTERS: Record<Filter, (photo: PhotoFacts) => boolean> = {
  all: () => true,
  todo: (photo) => photo.status !== "excluded" && grade(photo) !== "good",
  registered: (photo) => photo.status === "registered",
  out: (photo) => photo.status === "excluded",
};

/** The photos that a choice lists, in its order; numbers that are not known come last. */
export function listed(photos: PhotoFacts[], { search, filter, order }: Choice): PhotoFacts[] {
  const words = search.toLowerCase().split(/\s+/).filter(Boolean);
  const found = photos.filter((photo) => FILTERS[filter](photo) && words.every((word) => photo.name.toLowerCase().includes(word)));
  if (order === "worst") return worstFirst(found);
  const number = { error: expected, residual }[order as "error" | "residual"];
  return found.sort((a, b) => (number ? by(number(b) ?? -1, number(a) ?? -1) : 0) || byName(a, b));
}

const expected = (photo: PhotoFacts) => photo.expected_error_px ?? null;

/** Median residual of what was matched, full-size pixels. */
export function residual(photo: PhotoFacts): number | null {
  const found = photo.quality?.median_residual_px;
  return typeof found === "number" ? found : null;
}

/** Keeps the row of each photo while nothing of it changes, so that 500 photos do not lag. */
export class PhotoList {
  choice: Choice = { search: "", filter: "all", order: "worst" };
  private rows = new Map<string, { key: string; item: HTMLLIElement }>();

  /** changed: called when another choice is made. */
  constructor(changed: () => void) {
    const search = byId<HTMLInputElement>("photo-search");
    const [filter, order] = [byId<HTMLSelectElement>("photo-filter"), byId<HTMLSelectElement>("photo-order")];
    const read = () => {
      this.choice = { search: search.value, filter: filter.value as Filter, order: order.value as Order };
      changed();
    };
    for (const control of [search, filter, order]) control.addEventListener("input", read);
  }

  /** colors: whether each photo is marked with its color in layer Source. */
  show(photos: PhotoFacts[], chosen: string | null, colors: boolean, act: ListActions): void {
    const list = byId("photo-list");
    const focused = document.activeElement?.closest<HTMLElement>(".photo")?.dataset.photo;
    const numbers = new Map(photos.map((photo, i) => [photo.name, i]));
    const items = listed(photos, this.choice).map((photo) => {
      const color = colors && photo.camera ? css(PALETTE[numbers.get(photo.name)! % 256]) : "";
      return this.row(photo, photo.name === chosen, color, act);
    });
    if (items.length !== list.children.length || items.some((item, i) => list.children[i] !== item)) {
      list.replaceChildren(...items);
      if (focused) list.querySelector<HTMLElement>(`[data-photo="${CSS.escape(focused)}"]`)?.focus();
    }
    byId("photo-count").textContent = summary(photos);
    byId("photo-none").hidden = items.length > 0;
  }

  private row(photo: PhotoFacts, chosen: boolean, color: string, act: ListActions): HTMLLIElement {
    const key = JSON.stringify([photo, chosen, color]);
    const known = this.rows.get(photo.name);
    if (known?.key === key) return known.item;
    const item = rowOf(photo, chosen, color, act);
    this.rows.set(photo.name, { key, item });
    return item;
  }
}

function summary(photos: PhotoFacts[]): string {
  const used = photos.filter((p) => p.status !== "excluded");
  const done = used.filter((p) => p.status === "registered").length;
  return `${done} of ${used.length} registered`;
}

function rowOf(photo: PhotoFacts, chosen: boolean, color: string, act: ListActions): HTMLLIElement {
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
    buttons(photo, act),
  );
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
  const on = (go: () => void) => (event: Event) => {
    event.stopPropagation();
    go();
  };
  const out = (words: string, left: boolean) =>
    el("button", { type: "button", class: "leave-out", onclick: on(() => act.leaveOut(photo, left)) }, words);
  if (photo.status === "excluded") return el("div", { class: "row" }, out("Take it back", false));
  if (photo.status === "broken") return el("div", { class: "row" }, out("Leave out", true));
  const view = el("button", { type: "button", onclick: on(() => act.view(photo)) }, "View");
  view.disabled = !photo.camera;
  const pick = el("button", { type: "button", class: "pick", onclick: on(() => act.pick(photo)) }, "Pick points");
  return el("div", { class: "row" }, view, pick, out("Leave out", true));
}

function thumb(photo: PhotoFacts): HTMLElement {
  if (photo.status === "broken") return el("div", { class: "thumb" }, "unreadable");
  if (photo.status === "excluded") return el("div", { class: "thumb" }, "left out");
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

const pixels = (value: number) => `${value.toFixed(value < 10 ? 2 : 0)} px`;

function stateOf(photo: PhotoFacts): string {
  const error = photo.expected_error_px;
  if (photo.status === "registered") {
    const known = error != null ? `\u00b1 ${pixels(error)}` : "";
    return photo.weak ? `Weak, ${known}` : known ? `Good, ${known}` : "Registered";
  }
  const words = {
    broken: "Cannot be read", failed: "Failed", none: "Not registered", prior: "Approximate", excluded: "Left out",
  };
  return words[photo.status];
}

const METHODS: Record<string, string> = {
  points: "from points",
  import: "imported",
  structure: "from structure",
  silhouette: "from the silhouette",
  features: "from features",
  "mutual-information": "from mutual information",
  block: "with the others",
};

/** How a photo's camera was found. */
export function methodWords(photo: PhotoFacts): string {
  return photo.method ? (METHODS[photo.method] ?? photo.method) : "";
}

function factsOf(photo: PhotoFacts): string {
  const parts = [];
  const found = residual(photo);
  if (found !== null) parts.push(`residual ${pixels(found)}`);
  if (photo.method) parts.push(methodWords(photo));
  if (photo.picks) parts.push(`${photo.picks} picks`);
  if (photo.mask) parts.push("mask");
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

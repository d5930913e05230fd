// Photos that are being placed all together, and the question which of several places is right.

import * as THREE from "three";
import type { Places as Facts, Place } from "./api.ts";
import * as api from "./api.ts";
import { byId, el, section } from "./dom.ts";
import { cornersOf, EDGES } from "./frustums.ts";
import { center as eye } from "./lens.ts";
import type { Host } from "./host.ts";
import { lockButtons } from "./notice.ts";
import { through } from "./pictures.ts";

/** Of the places in turn; far from each other, and from what a scan looks like. */
const COLORS = [0x4fc3f7, 0xffb347, 0xd58bff, 0x8be28b];
/** Length of the drawn cameras, part of the scene's radius. */
const DEPTH = 0.09;
const PICTURE_WIDTH = 320;

export class Places {
  readonly group = new THREE.Group();
  private facts: Facts = { draft: null, question: null };
  /** The question is put off until somebody asks for it. */
  private later = false;
  private drawn = "";

  constructor(private readonly app: Host) {
    app.viewport.marks.add(this.group);
  }

  /** Read anew what is asked and what is being tried. */
  async load(): Promise<void> {
    const found = await api.places().catch(() => null);
    if (found) this.facts = found;
  }

  /** Whether there is something to choose now. */
  get asking(): boolean {
    const { question } = this.facts;
    return question !== null && question.answer === null;
  }

  /** What is written over the view; which place it is seen from, if it is one of them. */
  title(words: string): string {
    const found = this.places.findIndex((place) => Object.values(place.cameras).includes(this.app.viewport.photoCamera!));
    return found >= 0 ? `${words}, place ${found + 1}` : words;
  }

  private get places(): Place[] {
    return this.facts.question?.places ?? [];
  }

  /** Draw the card and what stands for it in the 3D view. visible: not while picking or painting. */
  show(visible: boolean): void {
    if (!this.app.viewport.surface.faces) return;
    const asked = visible && this.asking && !this.later;
    const draft = this.facts.draft;
    this.mark(!visible ? [] : asked ? this.places : draft ? [draft] : []);
    const card = byId("places");
    const key = asked ? JSON.stringify(this.facts.question) : "";
    card.hidden = !asked;
    if (card.dataset.key === key) return;
    card.dataset.key = key;
    card.replaceChildren(...(asked ? this.card() : []));
    if (asked) requestAnimationFrame(() => this.fill(card));
  }

  /** Words and a button for the panel, where something was chosen or may be chosen later. */
  section(): HTMLElement[] {
    const question = this.facts.question;
    if (!question || (this.asking && !this.later)) return [];
    const number = question.answer;
    const placed = this.app.photos.some((photo) => photo.quality?.chosen_place === number);
    if (number !== null && number > 0 && !placed) return [];
    const words = number === null ? "The photos fit in several places." : number > 0
      ? `Placed where you said: place ${number} of ${question.places.length}.`
      : "None of the places was right.";
    const again = el("button", {
      type: "button", id: "choose-again", "data-starts": "place", "data-busy": "Choosing\u2026", onclick: () => this.again(),
    }, number === null ? "Choose the place" : "Choose again");
    return [section("Place on the model", el("p", { class: "hint" }, words), el("div", { class: "button-row" }, again))];
  }

  private again(): void {
    this.later = false;
    if (this.asking) this.app.show();
    else void this.choose(null);
  }

  private async choose(number: number | null): Promise<void> {
    await this.app.start("place", { place: number });
  }

  private card(): HTMLElement[] {
    const { question } = this.facts;
    const places = question!.places;
    const head = places.map((place, k) =>
      el("th", { scope: "col" }, swatch(k), `Place ${k + 1}`, el("small", {}, ` ${Math.round(place.support * 100)} %`)),
    );
    const rows = question!.looks.map((name) =>
      el("tr", {}, el("th", { scope: "row" }, el("img", { src: api.imageUrl(name, 240), alt: name, title: name })), ...places.map((_, k) => this.look(name, k))),
    );
    const here = places.map((_, k) =>
      el("td", {}, el("button", {
        type: "button", class: "main", "data-place": k + 1, "data-starts": "place", "data-busy": "Placing\u2026",
        "aria-label": `It is here: place ${k + 1}`, onclick: () => void this.choose(k + 1),
      }, "It is here")),
    );
    const none = el("button", {
      type: "button", class: "quiet", id: "place-none", "data-starts": "place", "data-busy": "\u2026", onclick: () => void this.choose(0),
    }, "None of them");
    const later = el("button", {
      type: "button", class: "quiet", onclick: () => {
        this.later = true;
        this.app.show();
      },
    }, "Later");
    return [
      el("h2", {}, "Is it here, or here?"),
      el("p", {}, `${question!.photos.length} photos fit the model in ${places.length} places, so far as its shape tells. Which one shows what the photo shows? Click a picture to wipe the photo over it.`),
      el("table", {}, el("thead", {}, el("tr", {}, el("td"), ...head)), el("tbody", {}, ...rows, el("tr", {}, el("td"), ...here))),
      el("div", { class: "button-row end" }, later, none),
    ];
  }

  /** A picture of the model as one photo would show it from a place; a click goes there. */
  private look(name: string, k: number): HTMLElement {
    const camera = this.places[k].cameras[name];
    const canvas = el("canvas", { width: PICTURE_WIDTH, height: Math.round((PICTURE_WIDTH * camera.height) / camera.width) });
    canvas.dataset.look = `${name} ${k}`;
    return el("td", {}, el("button", {
      type: "button", class: "look", "aria-label": `Place ${k + 1} through ${name}`, onclick: () => this.enter(name, k),
    }, canvas));
  }

  private enter(name: string, k: number): void {
    this.app.lookThrough(name, this.places[k].cameras[name]);
  }

  /** Render what the card shows. */
  private fill(card: HTMLElement): void {
    for (const canvas of card.querySelectorAll<HTMLCanvasElement>("canvas[data-look]")) {
      const [, name, k] = /^(.*) (\d+)$/.exec(canvas.dataset.look!)!;
      through(this.app.viewport, this.places[Number(k)].cameras[name], canvas);
    }
    card.dataset.filled = "true";
    lockButtons();
  }

  /** Cameras and points of places in the 3D view, a color each. */
  private mark(places: Place[]): void {
    const { center, radius } = this.app.viewport.surface;
    this.group.visible = !this.app.viewport.photoCamera;
    const key = JSON.stringify([places, center, radius]);
    if (key === this.drawn) return;
    this.drawn = key;
    const begun = this.group.children.length === 0;
    for (const old of this.group.children as Drawn[]) old.geometry.dispose();
    this.group.clear();
    places.forEach((place, k) => this.group.add(camerasOf(place, center, radius * DEPTH, COLORS[k]), pointsOf(place, center, COLORS[k])));
    if (begun && places.length) this.app.viewport.frame(reachOf(places, center));
  }
}

/** A little more than how far from the model's middle the farthest camera is. */
function reachOf(places: Place[], middle: THREE.Vector3): number {
  const cameras = places.flatMap((place) => Object.values(place.cameras));
  return 1.2 * Math.max(...cameras.map((camera) => new THREE.Vector3(...eye(camera)).distanceTo(middle)));
}

type Drawn = THREE.LineSegments | THREE.Points;

function swatch(k: number): HTMLElement {
  const square = el("i");
  square.style.background = `#${COLORS[k].toString(16).padStart(6, "0")}`;
  return square;
}

function camerasOf(place: Place, center: THREE.Vector3, depth: number, color: number): Drawn {
  const corners = Object.values(place.cameras).flatMap((camera) => {
    const found = cornersOf(camera, center, depth);
    return EDGES.map((i) => found[i]);
  });
  return new THREE.LineSegments(new THREE.BufferGeometry().setFromPoints(corners), new THREE.LineBasicMaterial({ color }));
}

function pointsOf(place: Place, center: THREE.Vector3, color: number): Drawn {
  const points = place.points.map((p) => new THREE.Vector3(...p).sub(center));
  return new THREE.Points(new THREE.BufferGeometry().setFromPoints(points), new THREE.PointsMaterial({ color, size: 3, sizeAttenuation: false }));
}

// The panel of the relit surface: where the sun stands, its color, the sky, the curve.

import { check, el, section, slider } from "./dom.ts";
import type { Choice, Sky } from "./lightchoice.ts";
import { TONES } from "./lightchoice.ts";

const NAMES: Record<string, string> = { none: "None", reinhard: "Reinhard", filmic: "Filmic", aces: "ACES" };
const STEP_DEG = 5;

/** What there is to choose. skies: those that there are, and their names; splits: whether there is something to compare with; picture: the name of the one that was opened, open: opens another. */
interface Offer {
  skies: string[][];
  splits: boolean;
  picture: string | null;
  open(file: File): void;
}

/** ev: how it is exposed now; act: changes what is shown. */
export function relightSection(choice: Choice, { skies, splits, picture, open }: Offer, ev: () => number, act: (part: Partial<Choice>) => void): HTMLElement {
  const words = () => `EV ${ev().toFixed(1)}`;
  const exposed = el("output", { id: "relight-ev", title: "As a camera meters it, at ISO 100; Exposure brightens" }, words());
  const change = (part: Partial<Choice>) => {
    act(part);
    exposed.textContent = words();
  };
  const kelvin = slider(
    "Color of the sun", { min: 2000, max: 12000, step: 250, value: choice.kelvin }, (value) => `${value} K`, (value) => change({ kelvin: value }),
  );
  return section(
    "Light",
    el("div", { class: "light-row" }, sunDial(choice, change), el("div", { class: "stack" }, check("Sun", choice.sun, (sun) => change({ sun })), exposed)),
    kelvin,
    menu("Sky", choice.sky, skies, (sky) => change({ sky: sky as Sky })),
    opener(picture, open),
    menu("Tone curve", choice.tone, TONES.map((tone) => [tone, NAMES[tone]]), (tone) => change({ tone: tone as Choice["tone"] })),
    ...(splits ? [check("As photographed | relit", choice.split, (split) => change({ split }))] : []),
  );
}

/** Opens a picture of all directions; it stays in the browser. */
function opener(picture: string | null, open: (file: File) => void): HTMLElement {
  const input: HTMLInputElement = el("input", {
    id: "sky-file", type: "file", accept: ".hdr,.exr", class: "hidden-file", "aria-label": "Light from a picture of all directions, .hdr or .exr",
    onchange: () => input.files?.[0] && open(input.files[0]),
  });
  const words = picture ? `Light from ${picture}` : "Light from a picture\u2026";
  return el("label", { class: "button", title: "A Radiance .hdr or OpenEXR picture of all directions, twice as wide as high" }, words, input);
}

function menu(name: string, value: string, options: string[][], act: (value: string) => void): HTMLElement {
  const choice = el("select", { onchange: () => act(choice.value) }, ...options.map(([key, words]) => el("option", { value: key, selected: key === value }, words)));
  return el("label", { class: "stacked" }, name, choice);
}

/** Seen from above: the middle is overhead, the rim level; below is the viewer. */
function sunDial(choice: Choice, act: (part: Partial<Choice>) => void): HTMLElement {
  const dot = el("i");
  const dial = el("div", {
    id: "sun-dial", class: "dial", tabindex: 0, role: "application", "aria-label": "Where the sun stands, seen from above; arrow keys turn and raise it",
  }, dot);
  const draw = () => {
    const [away, heading] = [(90 - choice.height) / 90, (choice.heading * Math.PI) / 180];
    dot.style.left = `${50 + 46 * away * Math.sin(heading)}%`;
    dot.style.top = `${50 + 46 * away * Math.cos(heading)}%`;
    dial.title = `${Math.round(choice.heading)}\u00b0 to the right of the viewer, ${Math.round(choice.height)}\u00b0 high`;
  };
  const put = (heading: number, height: number) => {
    act({ heading: ((((heading + 180) % 360) + 360) % 360) - 180, height: Math.min(Math.max(height, 0), 90) });
    draw();
  };
  const follow = (event: PointerEvent) => {
    const box = dial.getBoundingClientRect();
    const x = ((event.clientX - box.left) / box.width) * 2 - 1;
    const y = ((event.clientY - box.top) / box.height) * 2 - 1;
    put((Math.atan2(x, y) * 180) / Math.PI, 90 - 90 * Math.min(Math.hypot(x, y) / 0.92, 1));
  };
  dial.addEventListener("pointerdown", (event) => {
    dial.setPointerCapture(event.pointerId);
    follow(event);
  });
  dial.addEventListener("pointermove", (event) => {
    if (event.buttons) follow(event);
  });
  dial.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: [-STEP_DEG, 0], ArrowRight: [STEP_DEG, 0], ArrowUp: [0, STEP_DEG], ArrowDown: [0, -STEP_DEG] }[event.key];
    if (!step) return;
    event.preventDefault();
    event.stopPropagation();
    put(choice.heading + step[0], choice.height + step[1]);
  });
  draw();
  return dial;
}

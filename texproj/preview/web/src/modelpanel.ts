// What is made of the photos, and what one takes away from here.

import type { Facts } from "./api.ts";
import { el, section } from "./dom.ts";

export interface ModelActions {
  /** Make vertices, a texture or patches from now on. */
  make(to: string): void;
  takePicture(): void;
  film(): void;
}

const KINDS: Record<string, string> = {
  texture: "Blended texture",
  patches: "Texture of patches",
  vertices: "Vertex colors",
};

export function modelSection(facts: Facts, act: ModelActions): HTMLElement {
  const options = Object.entries(KINDS).map(([to, words]) => el("option", { value: to, selected: to === facts.to }, words));
  const choice = el("select", { id: "make-to", onchange: () => act.make(choice.value) }, ...options);
  const links = facts.downloads.map(({ name, word }) =>
    el("a", { class: "button", href: `/api/downloads/${name}`, download: "" }, `Download ${word}`),
  );
  const report = facts.report ? [el("a", { class: "button", href: "/report", target: "_blank", rel: "noopener" }, "Open the report")] : [];
  const picture = el("button", { type: "button", id: "take-picture", onclick: () => act.takePicture() }, "Take a picture");
  const film = el("button", {
    type: "button", id: "film", title: "Once around, or to and fro in front of it", "data-starts": "turntable", "data-busy": "Filming\u2026",
    "data-off": !facts.downloads.some(({ name }) => name.startsWith("model.")), onclick: () => act.film(),
  }, "Film the model");
  return section(
    "Model",
    el("label", { class: "stacked" }, "To be made", choice),
    el("div", { class: "button-row" }, ...links, ...report, picture, film),
  );
}

/** Hand a picture over to the browser as a file. */
export async function download(dataUrl: string, name: string): Promise<void> {
  const [head, data] = dataUrl.split(",");
  const bytes = Uint8Array.from(atob(data), (letter) => letter.charCodeAt(0));
  const url = URL.createObjectURL(new Blob([bytes], { type: head.slice(5).split(";")[0] }));
  el("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}

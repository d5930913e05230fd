// What the page is about, in its head.

import type { Facts } from "./api.ts";
import { byId } from "./dom.ts";

/** faces: of the model, 0 as long as it is not loaded. */
export function showTitle({ name, photos, mesh }: Facts, { faces }: { faces: number }): void {
  if (!document.title.includes(name)) document.title = `${name} \u2013 texproj`;
  byId("project-name").textContent = name;
  byId("project-facts").textContent = `${photos.length} photos, ${faces ? `${faces.toLocaleString("en")} faces` : mesh.file}`;
}

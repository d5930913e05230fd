// Numbered marks over the photo and over the model, and what they look like.

import type { Fit } from "./api.ts";
import { svg } from "./dom.ts";
import type { Vec2 } from "./lens.ts";
import type { Pick } from "./picks.ts";
import { isPair } from "./picks.ts";

export interface Mark {
  pick: Pick;
  at: Vec2;
  /** Where the fit puts it, magnified; drawn as the residual. */
  tip?: Vec2;
  amount?: string;
  outlier: boolean;
  selected: boolean;
  /** Left out of the fit. */
  unused: boolean;
  /** On the far side of the model. */
  away: boolean;
  /** A prediction that nobody accepted yet. */
  guess: boolean;
}

const RADIUS = 9;
export const GRAB_PX = 14;

export function drawMarks(layer: Element, marks: Mark[], cursor: Vec2 | null): void {
  const parts = marks.map(markOf);
  if (cursor) parts.push(cursorOf(cursor));
  layer.replaceChildren(...parts);
}

function markOf(mark: Mark): SVGElement {
  const [x, y] = mark.at;
  const names = Object.entries({
    outlier: mark.outlier, unused: mark.unused, selected: mark.selected, away: mark.away, guess: mark.guess, open: !isPair(mark.pick),
  });
  const group = svg("g", { class: ["mark", ...names.filter(([, on]) => on).map(([name]) => name)].join(" "), "data-pick": mark.pick.name });
  if (mark.tip) {
    const ends = { x1: x, y1: y, x2: mark.tip[0], y2: mark.tip[1] };
    group.append(svg("line", { class: "residual-halo", ...ends }), svg("line", { class: "residual", "marker-end": mark.outlier ? "url(#arrow-bad)" : "url(#arrow)", ...ends }));
  }
  group.append(
    svg("circle", { class: "halo", cx: x, cy: y, r: RADIUS }),
    svg("circle", { class: "ring", cx: x, cy: y, r: RADIUS }),
    svg("line", { class: "cross", x1: x - 3.5, x2: x + 3.5, y1: y, y2: y }),
    svg("line", { class: "cross", x1: x, x2: x, y1: y - 3.5, y2: y + 3.5 }),
    svg("text", { x: x + 13, y: y + 4 }, mark.pick.name, svg("tspan", { class: "amount", dx: 5 }, mark.amount ?? "")),
  );
  return group;
}

function cursorOf([x, y]: Vec2): SVGElement {
  return svg(
    "g", { class: "cursor" },
    svg("line", { x1: x - 18, x2: x + 18, y1: y, y2: y }),
    svg("line", { x1: x, x2: x, y1: y - 18, y2: y + 18 }),
  );
}

/** The mark under a point of the pane, nearest first. */
export function markUnder(marks: Mark[], at: Vec2): Mark | null {
  const distance = (mark: Mark) => Math.hypot(mark.at[0] - at[0], mark.at[1] - at[1]);
  const near = marks.filter((mark) => distance(mark) < GRAB_PX && !mark.guess);
  return near.sort((a, b) => distance(a) - distance(b))[0] ?? null;
}

const FACTORS = [50, 20, 10, 5, 2, 1];
const LONGEST_PX = 70;

/** How much residuals are drawn longer than they are, so that the inliers' can be seen. */
export function magnification(fit: Fit | null, scale: number): number {
  const good = fit?.residual_px.filter((r, i) => r !== null && fit.inliers[i]) as number[] | undefined;
  const longest = Math.max(...(good?.length ? good : [1])) * scale;
  return FACTORS.find((factor) => factor * longest <= LONGEST_PX) ?? 1;
}

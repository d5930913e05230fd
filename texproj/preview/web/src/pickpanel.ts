// The right-hand panel while picking: how it stands, the list of pairs, what can be done.

import type { PhotoFacts } from "./api.ts";
import { check, el, section, slider } from "./dom.ts";
import type { PickMode } from "./pickmode.ts";
import type { Pick } from "./picks.ts";
import { isPair } from "./picks.ts";

export function pickPanel(mode: PickMode): HTMLElement[] {
  const parts = [stateSection(mode), pairsSection(mode), viewSection(mode)];
  if (mode.before && mode.photo?.camera) parts.splice(1, 0, compareSection(mode));
  return parts;
}

function stateSection(mode: PickMode): HTMLElement {
  const { kind, words } = verdict(mode);
  const count = mode.picks.filter(isPair).length;
  const solve = el("button", { type: "button", class: "main", id: "solve", "data-starts": "solve", "data-busy": "Solving\u2026", onclick: () => void mode.solve() }, "Solve camera");
  solve.dataset.off = String(count < 4);
  const leave = el("button", { type: "button", id: "leave-pick", onclick: () => mode.leave() }, "Done");
  return section(
    "Picking",
    el("p", { class: `verdict ${kind}`, id: "verdict" }, words),
    el("div", { class: "button-row" }, solve, leave),
    el("p", { class: "hint", id: "saved", "data-state": mode.saved }, SAVED[mode.saved]),
  );
}

const SAVED = { saved: "Saved in the project.", saving: "Saving\u2026", unsaved: "Not saved yet." };

function verdict(mode: PickMode): { kind: string; words: string } {
  const count = mode.picks.filter(isPair).length;
  const pick = mode.selectedPick;
  if (pick && !isPair(pick)) return { kind: "", words: openWords(mode, pick) };
  if (count < 4) {
    const first = count === 0 ? "Click a point that you can find again in both pictures." : "";
    return { kind: "", words: first || `${4 - count} more point${count === 3 ? "" : "s"} until the camera can be solved.` };
  }
  if (mode.fitProblem) return { kind: "bad", words: mode.fitProblem };
  const fit = mode.fit;
  if (!fit) return { kind: "", words: "\u2026" };
  const bad = fit.names.filter((_, i) => !fit.inliers[i]);
  if (bad.length) return { kind: "warn", words: `Point ${bad.join(", ")} does not fit the others: move or delete it.` };
  if (!fit.accepted) return { kind: "bad", words: fit.reason };
  const error = fit.expected_error_px;
  const sure = error === null ? "" : ` Expected error on the surface: \u00b1 ${error.toFixed(1)} px.`;
  return { kind: "good", words: `The points fit one camera.${sure}${fit.reason ? ` ${fit.reason}` : ""}` };
}

function openWords(mode: PickMode, pick: Pick): string {
  const other = pick.uv ? "on the model" : "in the photo";
  if (!mode.guess) return `Now click point ${pick.name} ${other}.`;
  const how = mode.guess.score > 0 ? `a match (${Math.round(mode.guess.score * 100)} %)` : "the predicted place";
  return `Point ${pick.name} ${other}: Enter takes ${how}, or click it yourself.`;
}

function pairsSection(mode: PickMode): HTMLElement {
  const undo = el("button", { type: "button", id: "undo", onclick: () => mode.undo() }, "Undo");
  const redo = el("button", { type: "button", id: "redo", onclick: () => mode.redo() }, "Redo");
  undo.disabled = !mode.history.canUndo;
  redo.disabled = !mode.history.canRedo;
  const head = el("tr", {}, el("th", {}, "Point"), el("th", {}, "Residual"), el("td", {}));
  const rows = worstFirst(mode).map((pick) => rowOf(mode, pick));
  const table = el("table", { class: "pairs" }, el("thead", {}, head), el("tbody", {}, ...rows));
  const body = rows.length ? table : el("p", { class: "hint" }, "No points yet.");
  return section("Points", body, el("div", { class: "button-row" }, undo, redo));
}

/** What is half set first, then by residual, the largest first; in their order before a fit. */
function worstFirst({ picks, fit }: PickMode): Pick[] {
  const residual = (pick: Pick) => {
    if (!isPair(pick)) return Infinity;
    return fit?.residual_px[fit.names.indexOf(pick.name)] ?? 0;
  };
  const by = (a: number, b: number) => (a === b ? 0 : b - a);
  return [...picks].sort((a, b) => by(residual(a), residual(b)));
}

function rowOf(mode: PickMode, pick: Pick): HTMLElement {
  const index = mode.fit ? mode.fit.names.indexOf(pick.name) : -1;
  const residual = index >= 0 && isPair(pick) ? mode.fit!.residual_px[index] : null;
  const outlier = index >= 0 && !mode.fit!.inliers[index];
  const words = isPair(pick) ? (residual === null ? "\u2013" : `${residual.toFixed(1)} px`) : pick.uv ? "photo only" : "model only";
  const remove = el("button", {
    type: "button", class: "quiet", "aria-label": `Delete point ${pick.name}`, title: "Delete",
    onclick: (event: Event) => {
      event.stopPropagation();
      mode.remove(pick.name);
    },
  }, "\u00d7");
  return el(
    "tr",
    {
      class: outlier ? "outlier" : "", "data-pick": pick.name, "aria-current": pick.name === mode.selected,
      title: "Go there", onclick: () => mode.flyTo(pick.name),
    },
    el("td", {}, pick.name), el("td", { class: isPair(pick) ? "" : "open" }, words), el("td", {}, remove),
  );
}

function viewSection(mode: PickMode): HTMLElement {
  const { app } = mode;
  const through = check("Look through this photo", app.viewport.photoCamera !== null, (on) => mode.lookThrough(on));
  through.querySelector("input")!.disabled = !mode.camera;
  const parts: HTMLElement[] = [through];
  if (app.viewport.photoCamera) {
    const percent = (value: number) => `${Math.round(value * 100)} %`;
    parts.push(
      check("Move both pictures together", mode.linked, (on) => (mode.linked = on)),
      slider("Photo over model", { min: 0, max: 1, step: 0.01, value: app.look.opacity }, percent, (opacity) => app.change({ opacity })),
    );
  }
  parts.push(check("Snap to the best match", mode.snap, (on) => (mode.snap = on)));
  return section("View", ...parts);
}

function compareSection(mode: PickMode): HTMLElement {
  const choose = (before: boolean) => () => {
    mode.showBefore = before;
    mode.lookThrough(true);
    mode.app.change({ opacity: 0.5 });
    mode.app.show();
  };
  const button = (name: string, before: boolean) =>
    el("button", { type: "button", "aria-pressed": mode.showBefore === before, onclick: choose(before) }, name);
  return section(
    "Before and after",
    el("p", { class: "hint" }, afterWords(mode.photo!)),
    el("div", { class: "choices" }, button("Before", true), button("After", false)),
  );
}

function afterWords(photo: PhotoFacts): string {
  const error = photo.expected_error_px;
  return error == null ? "Solved." : `Solved: \u00b1 ${error.toFixed(1)} px on the surface.`;
}

// The right-hand panel while picking: how it stands, the list of pairs, what can be done.

import type { PhotoFacts } from "./api.ts";
import { check, el, exposureSlider, section, slider } from "./dom.ts";
import { methodWords } from "./photolist.ts";
import type { PickMode } from "./pickmode.ts";
import type { Pick } from "./picks.ts";
import { isPair } from "./picks.ts";

export function pickPanel(mode: PickMode): HTMLElement[] {
  const parts = [stateSection(mode), pairsSection(mode), viewSection(mode)];
  if (mode.live.proposals.length) parts.splice(1, 0, proposalSection(mode));
  if (mode.before && mode.photo?.camera) parts.splice(1, 0, compareSection(mode));
  return parts;
}

function stateSection(mode: PickMode): HTMLElement {
  const { kind, words } = verdict(mode);
  const count = mode.picks.filter(isPair).length;
  const others = settled(mode) && mode.photo?.status === "registered" ? mode.app.unregistered : 0;
  const solve = el("button", { type: "button", class: others ? "" : "main", id: "solve", "data-starts": "solve", "data-busy": "Solving\u2026", onclick: () => void mode.solve() }, "Solve camera");
  solve.dataset.off = String(count < 4);
  const leave = el("button", { type: "button", id: "leave-pick", onclick: () => mode.leave() }, "Done");
  return section(
    "Picking",
    el("p", { class: `verdict ${kind}`, id: "verdict" }, words.charAt(0).toUpperCase() + words.slice(1)),
    el("div", { class: "button-row" }, solve, leave),
    ...(others ? [othersButton(mode, others)] : []),
    el("p", { class: "hint", id: "saved", "data-state": mode.saved }, SAVED[mode.saved]),
  );
}

const SAVED = { saved: "Saved in the project.", saving: "Saving\u2026", unsaved: "Not saved yet." };

function verdict(mode: PickMode): { kind: string; words: string } {
  const count = mode.picks.filter(isPair).length;
  const pick = mode.selectedPick;
  if (pick && !isPair(pick)) return { kind: "", words: openWords(mode, pick) };
  if (settled(mode) && mode.photo?.status === "registered") return { kind: "good", words: registeredWords(mode.photo) };
  if (settled(mode) && mode.solved && mode.photo?.status === "failed") return { kind: "bad", words: mode.photo.reason ?? "" };
  if (count < 4) {
    const first = count === 0 ? "Click a point that you can find again in both pictures." : "";
    return { kind: "", words: first || `${4 - count} more point${count === 3 ? "" : "s"} until the camera can be solved.` };
  }
  const { off, found: fit, problem } = mode.live;
  const without = off.size ? `Without point ${[...off].join(", ")}: ` : "";
  if (problem) return { kind: "bad", words: without + problem };
  if (!fit) return { kind: "", words: "\u2026" };
  if (!fit.accepted) return { kind: "bad", words: without + fit.reason };
  const bad = fit.names.filter((name) => mode.live.outlier(name));
  if (bad.length) return { kind: "warn", words: `${without}Point ${bad.join(", ")} does not fit the others: move or delete it.` };
  const error = fit.expected_error_px;
  const sure = error === null ? "" : ` Expected error on the surface: \u00b1 ${error.toFixed(1)} px.`;
  return { kind: "good", words: `${without}The points fit one camera.${sure}${fit.reason ? ` ${fit.reason}` : ""}` };
}

/** Whether what the registration said of the photo still counts: no pick is other since then. */
function settled(mode: PickMode): boolean {
  return !mode.edited && mode.live.off.size === 0;
}

/** What registration said of the photo. */
function registeredWords(photo: PhotoFacts): string {
  const error = photo.expected_error_px;
  const sure = error == null ? "" : ` Expected error on the surface: \u00b1 ${error.toFixed(1)} px.`;
  return `This photo is registered ${methodWords(photo)}.${sure}`;
}

function othersButton(mode: PickMode, others: number): HTMLElement {
  const words = others === 1 ? "Find the other photo from this one" : `Find the other ${others} photos from this one`;
  const start = () => void mode.app.start("register");
  return el("button", {
    type: "button", class: "main", id: "find-others", "data-starts": "register", "data-busy": "Finding the others\u2026", onclick: start,
  }, words);
}

/** Points that other photos have and this one lacks. */
function proposalSection(mode: PickMode): HTMLElement {
  const now = mode.proposal;
  const rows = mode.live.proposals.slice(0, 6).map((proposal) =>
    el(
      "li", { "aria-current": proposal === now },
      el("button", { type: "button", class: "quiet", title: "Go there", onclick: () => mode.showProposal(proposal) }, `${proposal.name} of ${proposal.photo}`),
      el("button", { type: "button", "aria-label": `Take point ${proposal.name} of ${proposal.photo}`, onclick: () => void mode.acceptProposal(proposal) }, "Take"),
    ),
  );
  return section(
    "Points of other photos",
    el("p", { class: "hint" }, "Where they should lie in this photo: ", el("kbd", {}, "Enter"), " takes the bright one, ", el("kbd", {}, "N"), " goes on."),
    el("ul", { class: "proposals" }, ...rows),
  );
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
  const head = el("tr", {}, el("td", {}), el("th", {}, "Point"), el("th", {}, "Residual"), el("td", {}));
  const rows = worstFirst(mode).map((pick) => rowOf(mode, pick));
  const table = el("table", { class: "pairs" }, el("thead", {}, head), el("tbody", {}, ...rows));
  const body = rows.length ? table : el("p", { class: "hint" }, "No points yet.");
  return section("Points", body, el("div", { class: "button-row" }, undo, redo));
}

/** What is half set first, then by residual, the largest first; in their order before a fit. */
function worstFirst({ picks, live }: PickMode): Pick[] {
  const residual = (pick: Pick) => (isPair(pick) ? (live.residual(pick.name) ?? 0) : Infinity);
  const by = (a: number, b: number) => (a === b ? 0 : b - a);
  return [...picks].sort((a, b) => by(residual(a), residual(b)));
}

function rowOf(mode: PickMode, pick: Pick): HTMLElement {
  const residual = isPair(pick) ? mode.live.residual(pick.name) : null;
  const words = isPair(pick) ? (residual === null ? "\u2013" : `${residual.toFixed(1)} px`) : pick.uv ? "photo only" : "model only";
  const off = mode.live.off.has(pick.name);
  const use = el("input", {
    type: "checkbox", "aria-label": `Count point ${pick.name}`, title: "Untick to see the fit without it",
    onclick: (event: Event) => event.stopPropagation(),
    onchange: () => mode.use(pick.name, use.checked),
  });
  use.checked = !off;
  use.disabled = !isPair(pick);
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
      class: off ? "unused" : mode.live.outlier(pick.name) ? "outlier" : "", "data-pick": pick.name, "aria-current": pick.name === mode.selected,
      title: "Go there", onclick: () => mode.flyTo(pick.name),
    },
    el("td", {}, use), el("td", {}, pick.name), el("td", { class: isPair(pick) ? "" : "open" }, words), el("td", {}, remove),
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
  parts.push(
    check("Snap to the best match", mode.snap, (on) => (mode.snap = on)),
    exposureSlider(app.look.exposure, (exposure) => app.change({ exposure })),
  );
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

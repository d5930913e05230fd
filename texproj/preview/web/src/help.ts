// What mouse and keys do.

import { byId, el } from "./dom.ts";

const KEYS: Record<string, [string[], string][]> = {
  "Looking": [
    [["Drag"], "turn the model; right button or two fingers: move; wheel: zoom"],
    [["Double click"], "turn about that point from now on"],
    [["F"], "see the whole model"],
    [["1", "\u2013", "9"], "choose what is shown"],
    [["C"], "show or hide the cameras"],
    [["[", "]"], "roll the view"],
  ],
  "In a photo's view": [
    [["\u2190", "\u2192"], "previous and next photo"],
    [["Space"], "blink between photo and model"],
    [["Esc"], "leave the photo"],
  ],
  "Picking": [
    [["Click"], "set a point in one picture, then in the other; drag to move it"],
    [["Tab"], "go to the other picture"],
    [["Arrows"], "move the chosen point by 1 pixel, or the cursor if none is chosen (Shift: 10, Alt: 0.1)"],
    [["Enter"], "take the proposed point, else set one at the cursor"],
    [["+", "-"], "zoom"],
    [["N", "B"], "next and previous point, or proposed point of another photo"],
    [["Del"], "delete the chosen point"],
    [["Ctrl Z", "Ctrl Y"], "undo and redo"],
    [["S"], "solve the photo's camera"],
    [["Esc"], "let go of the point, then leave"],
  ],
  "Painting a mask": [
    [["Drag"], "paint or erase; right button: move; wheel: zoom"],
    [["[", "]"], "thinner and thicker brush"],
    [["X"], "paint or erase"],
    [["Arrows"], "move the brush; Enter sets a dot"],
    [["Ctrl Z"], "take the last step back"],
    [["Esc"], "leave"],
  ],
};

export function showHelp(): void {
  const dialog = byId<HTMLDialogElement>("help");
  const parts = Object.entries(KEYS).flatMap(([title, rows]) => [
    el("h3", {}, title),
    el("dl", {}, ...rows.flatMap(([keys, what]) => [
      el("dt", {}, ...keys.flatMap((key) => [key === "\u2013" ? " \u2013 " : el("kbd", {}, key), " "])),
      el("dd", {}, what),
    ])),
  ]);
  const close = el("form", { method: "dialog" }, el("button", { class: "main" }, "Close"));
  dialog.replaceChildren(el("h2", {}, "Mouse and keyboard"), ...parts, close);
  dialog.showModal();
}

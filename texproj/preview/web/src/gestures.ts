// Mouse, touch and keys of the result view.

import type { App } from "./app.ts";
import { byId, typing } from "./dom.ts";
import { showHelp } from "./help.ts";
import { LAYERS } from "./panel.ts";
import { at, onClick, onPanZoom } from "./pointer.ts";
import { clamp } from "./view.ts";

const ROLL_RAD = Math.PI / 12;

/** Connect the model's canvas, the wipe handle and the keys. */
export function connect(app: App): void {
  const { viewport } = app;
  const canvas = viewport.canvas;
  onPanZoom(canvas, () => viewport.photoCamera !== null && !app.picking.dragging, {
    pan: (dx, dy) => viewport.panPhoto(dx, dy),
    zoom: (factor, place) => viewport.zoomPhoto(factor, place),
  });
  onClick(canvas, (place) => {
    const name = app.mode === "view" ? viewport.photoUnder(place) : null;
    const photo = app.facts?.photos.find((item) => item.name === name);
    if (photo) app.view(photo);
  });
  canvas.addEventListener("dblclick", (event) => {
    if (app.mode === "view" && !viewport.photoCamera) void app.turnAbout(at(event, canvas));
  });
  canvas.addEventListener("pointermove", (event) => hover(app, event));
  connectWipe(app);
  addEventListener("keydown", (event) => {
    if (typing(event) || event.defaultPrevented) return;
    const used = app.mode === "pick" ? app.hands.key(event) : app.mode === "mask" ? app.masks.key(event) : key(app, event);
    if (used) event.preventDefault();
  });
  byId("do-help").addEventListener("click", showHelp);
}

function hover(app: App, event: PointerEvent): void {
  if (event.buttons || app.mode !== "view" || app.viewport.photoCamera) return;
  const name = app.viewport.photoUnder(at(event, app.viewport.canvas));
  byId("model-pane").classList.toggle("over-frustum", name !== null);
  const title = byId("model-title");
  if (title.textContent === (name ?? "")) return;
  title.textContent = name ?? "";
  app.viewport.frustums.mark(app.chosen, name);
  app.viewport.invalidate();
}

function connectWipe(app: App): void {
  const handle = byId("wipe");
  const set = (wipe: number) => {
    app.change({ wipe: clamp(wipe, 0, 1) });
    const slider = document.querySelector<HTMLInputElement>('input[aria-label="Wipe"]');
    if (slider) slider.value = String(app.look.wipe);
    if (slider) slider.previousElementSibling!.textContent = `${Math.round(app.look.wipe * 100)} %`;
  };
  handle.addEventListener("pointerdown", (event) => handle.setPointerCapture(event.pointerId));
  handle.addEventListener("pointermove", (event) => {
    if (event.buttons) set(at(event, app.viewport.canvas)[0] / app.viewport.size[0]);
  });
  handle.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -0.01, ArrowRight: 0.01 }[event.key];
    if (step === undefined) return;
    event.preventDefault();
    set(app.look.wipe + step * (event.shiftKey ? 10 : 1));
  });
}

function key(app: App, event: KeyboardEvent): boolean {
  if (event.ctrlKey || event.metaKey || event.altKey) return false;
  const inPhoto = app.viewport.photoCamera !== null;
  if (event.key === "?") showHelp();
  else if (event.key === " " && inPhoto) blink(app);
  else if (event.key === "Escape" && inPhoto) app.exitPhoto();
  else if (event.key === "ArrowLeft" && inPhoto) neighbor(app, -1);
  else if (event.key === "ArrowRight" && inPhoto) neighbor(app, 1);
  else if (event.key === "f") inPhoto ? fit(app) : app.viewport.frame();
  else if ((event.key === "[" || event.key === "]") && !inPhoto) app.viewport.roll(event.key === "[" ? -ROLL_RAD : ROLL_RAD);
  else if (event.key === "c") toggleCameras(app);
  else if (event.key === "p" && app.photo) void app.pick(app.photo);
  else if (/^[1-9]$/.test(event.key)) showLayer(app, Number(event.key));
  else return false;
  return true;
}

function showLayer(app: App, number: number): void {
  const entry = LAYERS[number - 1];
  if (entry) void app.setLayer(entry.layer);
}

function blink(app: App): void {
  const visible = app.look.opacity > 0.5;
  app.change({ opacity: visible ? 0 : 1 });
  app.show();
}

function fit(app: App): void {
  app.viewport.fitPhoto();
  app.viewport.setWindow(app.viewport.window);
}

function toggleCameras(app: App): void {
  app.change({ frustums: !app.look.frustums });
  app.show();
}

function neighbor(app: App, step: number): void {
  const photos = app.viewable;
  const index = photos.findIndex((photo) => photo.name === app.chosen);
  app.view(photos[(index + step + photos.length) % photos.length]);
}

// Mouse and keys of picking.

import { byId } from "./dom.ts";
import type { Vec2 } from "./lens.ts";
import { notice } from "./notice.ts";
import { drawLoupe } from "./pictures.ts";
import { showHelp } from "./help.ts";
import { at as placeOf, onClick, onPanZoom } from "./pointer.ts";
import type { PickMode } from "./pickmode.ts";
import type { Side } from "./pickmarks.ts";

const LOUPE_ZOOM = 4;
const LOUPE_PAUSE_MS = 50;
const ARROWS: Record<string, Vec2> = {
  ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1],
};

interface Drag {
  side: Side;
  name: string;
  started: boolean;
  from: Vec2;
  /** From the pointer to the mark's middle, so that it does not jump. */
  offset: Vec2;
}

export class PickHands {
  private dragged: Drag | null = null;
  private side: Side = "photo";
  private loupeTimer = 0;
  private asking = false;

  constructor(private readonly mode: PickMode) {
    const { pane, app } = mode;
    onPanZoom(pane.canvas, () => this.dragged === null, {
      pan: (dx, dy) => pane.pan(dx, dy),
      zoom: (factor, at) => pane.zoom(factor, at),
    });
    this.connect("photo", byId("photo-pane"), pane.canvas);
    this.connect("model", byId("model-pane"), app.viewport.canvas);
  }

  /** What a key does while picking; false if nothing. */
  key(event: KeyboardEvent): boolean {
    const { mode } = this;
    if ((event.ctrlKey || event.metaKey) && !event.altKey) return this.command(event);
    if (event.key in ARROWS) return this.arrow(event);
    const acts: Record<string, () => void> = {
      "?": showHelp,
      Tab: () => this.changeSide(),
      Enter: () => void this.enter(),
      Delete: () => mode.selected && mode.remove(mode.selected),
      Backspace: () => mode.selected && mode.remove(mode.selected),
      Escape: () => this.escape(),
      "+": () => this.zoom(1.25),
      "=": () => this.zoom(1.25),
      "-": () => this.zoom(0.8),
      n: () => mode.step(1),
      b: () => mode.step(-1),
      s: () => void mode.solve(),
      f: () => mode.pane.fit(),
    };
    const inPanel = (event.target as HTMLElement).closest("aside, header, nav, dialog") !== null;
    if (inPanel && ["Tab", "Enter"].includes(event.key)) return false;
    if (event.key === "Tab" && event.shiftKey) return false;
    const act = acts[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    act?.();
    return act !== undefined;
  }

  private connect(side: Side, pane: HTMLElement, canvas: HTMLCanvasElement): void {
    const { mode } = this;
    pane.addEventListener("pointerdown", (event) => this.press(side, event, canvas), { capture: true });
    pane.addEventListener("pointermove", (event) => this.drag(event, canvas), { capture: true });
    pane.addEventListener("pointerup", (event) => this.release(event), { capture: true });
    pane.addEventListener("pointermove", (event) => this.hover(side, event, canvas));
    pane.addEventListener("pointerleave", () => (byId("loupe").hidden = true));
    pane.addEventListener("focus", () => (this.side = side));
    onClick(canvas, (at) => {
      if (mode.active) void this.placeAt(side, at);
    });
  }

  /** Pressing on a mark takes hold of it; elsewhere the picture is moved or a point set. */
  private press(side: Side, event: PointerEvent, canvas: HTMLCanvasElement): void {
    if (!this.mode.active) return;
    this.side = side;
    this.mode.cursors = { photo: null, model: null };
    (event.currentTarget as HTMLElement).focus({ preventScroll: true });
    const at = placeOf(event, canvas);
    const mark = event.button === 0 ? this.mode.marks.under(side, at) : null;
    if (!mark) return;
    event.stopPropagation();
    event.preventDefault();
    (event.currentTarget as HTMLElement).setPointerCapture(event.pointerId);
    const offset: Vec2 = [mark.at[0] - at[0], mark.at[1] - at[1]];
    this.dragged = { side, name: mark.pick.name, started: false, from: at, offset };
    this.mode.dragging = true;
    this.mode.select(mark.pick.name);
  }

  private drag(event: PointerEvent, canvas: HTMLCanvasElement): void {
    const drag = this.dragged;
    if (!drag) return;
    const at = placeOf(event, canvas);
    if (!drag.started && Math.hypot(at[0] - drag.from[0], at[1] - drag.from[1]) < 3) return;
    if (!drag.started) this.mode.history.add(this.mode.picks);
    drag.started = true;
    void this.moveTo(drag, [at[0] + drag.offset[0], at[1] + drag.offset[1]]);
  }

  private release(event: PointerEvent): void {
    const drag = this.dragged;
    if (!drag) return;
    event.stopPropagation();
    this.dragged = null;
    this.mode.dragging = false;
    if (drag.started) this.mode.settle();
  }

  /** On the model the server is asked for the exact point; one question at a time. */
  private async moveTo(drag: Drag, at: Vec2): Promise<void> {
    if (drag.side === "photo") {
      this.mode.move(drag.name, { uv: this.mode.pane.toPhoto(at) }, false);
      return;
    }
    if (this.asking) return;
    this.asking = true;
    const found = await this.mode.app.hit(at);
    this.asking = false;
    if (found && !found.back) this.mode.move(drag.name, { xyz: found.xyz, normal: found.normal }, false);
    if (found && this.dragged !== drag) this.mode.settle();
  }

  private async placeAt(side: Side, at: Vec2): Promise<void> {
    if (side === "photo") this.mode.place(side, this.mode.pane.toPhoto(at), null);
    else {
      const found = await this.mode.app.hit(at);
      if (!found) notice("There is no surface there: click on the model.");
      else if (found.back) notice("That is the back of the surface, drawn dark: turn the model and click on its front.");
      else this.mode.place(side, null, found);
    }
  }

  private command(event: KeyboardEvent): boolean {
    const key = event.key.toLowerCase();
    if (key === "z" && !event.shiftKey) this.mode.undo();
    else if (key === "y" || key === "z") this.mode.redo();
    else return false;
    return true;
  }

  private arrow(event: KeyboardEvent): boolean {
    if ((event.target as HTMLElement).closest("aside")) return false;
    const size = event.shiftKey ? 10 : event.altKey ? 0.1 : 1;
    const [dx, dy] = ARROWS[event.key].map((step) => step * size);
    const pick = this.mode.selectedPick;
    const has = pick && (this.side === "photo" ? pick.uv : pick.xyz);
    if (pick && has) void this.nudge(pick.name, dx, dy);
    else this.moveCursor(dx, dy);
    return true;
  }

  private async nudge(name: string, dx: number, dy: number): Promise<void> {
    const { mode } = this;
    const pick = mode.selectedPick!;
    if (this.side === "photo") {
      mode.move(name, { uv: [pick.uv![0] + dx, pick.uv![1] + dy] });
      return;
    }
    const at = mode.app.viewport.toScreen(pick.xyz!);
    const found = at && (await mode.app.hit([at[0] + dx, at[1] + dy]));
    if (found && !found.back) mode.move(name, { xyz: found.xyz, normal: found.normal });
  }

  private moveCursor(dx: number, dy: number): void {
    const at = this.cursor();
    this.mode.cursors[this.side] = [at[0] + dx, at[1] + dy];
    this.loupe(this.side, this.cursor());
    this.mode.redraw();
  }

  private cursor(): Vec2 {
    const { mode } = this;
    const [w, h] = this.side === "photo" ? mode.pane.size : mode.app.viewport.size;
    return mode.cursors[this.side] ?? [w / 2, h / 2];
  }

  private async enter(): Promise<void> {
    if (this.mode.acceptGuess()) return;
    if (!this.mode.cursors[this.side] && this.mode.acceptProposal()) return;
    if (!this.mode.cursors[this.side]) this.moveCursor(0, 0);
    else await this.placeAt(this.side, this.cursor());
  }

  private changeSide(): void {
    this.side = this.side === "photo" ? "model" : "photo";
    byId(`${this.side}-pane`).focus({ preventScroll: true });
    if (!this.mode.cursors[this.side]) this.moveCursor(0, 0);
  }

  private escape(): void {
    if (this.mode.selected) this.mode.select(null);
    else this.mode.leave();
  }

  private zoom(factor: number): void {
    const { pane, app } = this.mode;
    if (this.side === "photo") pane.zoom(factor, this.cursor());
    else app.viewport.zoomAt(factor, this.cursor());
  }

  private hover(side: Side, event: PointerEvent, canvas: HTMLCanvasElement): void {
    if (!this.mode.active) return;
    const at = placeOf(event, canvas);
    clearTimeout(this.loupeTimer);
    if (event.buttons && !this.dragged) byId("loupe").hidden = true;
    else if (event.pointerType !== "touch") {
      const pause = side === "model" ? LOUPE_PAUSE_MS : 0;
      this.loupeTimer = window.setTimeout(() => this.loupe(side, at), pause);
    }
  }

  /** The magnifier beside `at`, with its crosshair on the exact place. */
  private loupe(side: Side, at: Vec2): void {
    if (!this.mode.active) return;
    const canvas = byId<HTMLCanvasElement>("loupe");
    const edge = Math.round(176 * devicePixelRatio);
    if (canvas.width !== edge) canvas.width = canvas.height = edge;
    const context = canvas.getContext("2d")!;
    context.fillStyle = "#2b2b2b";
    context.fillRect(0, 0, edge, edge);
    if (side === "photo") this.mode.pane.drawLoupe(context, at, LOUPE_ZOOM);
    else drawLoupe(this.mode.app.viewport, context, at, LOUPE_ZOOM);
    crosshair(context, edge);
    const pane = byId(`${side}-pane`);
    const below = at[1] < 230;
    canvas.style.left = `${Math.min(Math.max(pane.offsetLeft + at[0] - 88, 4), byId("work").clientWidth - 184)}px`;
    canvas.style.top = `${pane.offsetTop + at[1] + (below ? 36 : -212)}px`;
    canvas.dataset.side = side;
    canvas.hidden = false;
  }
}

function crosshair(context: CanvasRenderingContext2D, edge: number): void {
  for (const [color, width] of [["#000a", 3], ["#fff", 1]] as const) {
    context.strokeStyle = color;
    context.lineWidth = width * devicePixelRatio;
    context.beginPath();
    for (const [a, b] of [[0.1, 0.45], [0.55, 0.9]]) {
      context.moveTo(edge * a, edge / 2);
      context.lineTo(edge * b, edge / 2);
      context.moveTo(edge / 2, edge * a);
      context.lineTo(edge / 2, edge * b);
    }
    context.stroke();
  }
}

// The model in a report: one canvas to turn it, wipes between photo and model. No network.

import { onPanZoom } from "./pointer.ts";
import FRAGMENT from "./report.frag.glsl";
import VERTEX from "./report.vert.glsl";
import type { Model, Orbit, Packed } from "./reportmodel.ts";
import { clipFromModel, STEEPEST, unpacked } from "./reportmodel.ts";
import { clamp } from "./view.ts";

const TURN_RAD = 0.006;
const KEY_PX = 30;
const KEYS: Record<string, [number, number]> = {
  ArrowLeft: [-KEY_PX, 0], ArrowRight: [KEY_PX, 0], ArrowUp: [0, -KEY_PX], ArrowDown: [0, KEY_PX],
};
const START: Orbit = { turn: 0, rise: 0.2, distance: 1.7 };
const BACKGROUND = 0x2b / 255;

class Viewer {
  private readonly gl: WebGL2RenderingContext;
  private readonly program: WebGLProgram;
  private readonly orbit = { ...START };
  private readonly textures: (WebGLTexture | null)[] = [];
  private waiting = false;

  constructor(private readonly canvas: HTMLCanvasElement, private readonly packed: Packed, model: Model) {
    this.gl = canvas.getContext("webgl2", { antialias: true })!;
    this.program = this.linked();
    this.load(model);
    new ResizeObserver(() => this.draw()).observe(canvas);
    onPanZoom(canvas, () => true, {
      pan: (dx, dy) => this.turn(dx, dy),
      zoom: (factor) => this.zoom(factor),
    });
    canvas.addEventListener("dblclick", () => {
      Object.assign(this.orbit, START);
      this.draw();
    });
    canvas.addEventListener("keydown", (event) => {
      const by = KEYS[event.key];
      if (by) this.turn(...by);
      else if (event.key === "+" || event.key === "-") this.zoom(event.key === "+" ? 1.15 : 1 / 1.15);
      else return;
      event.preventDefault();
    });
  }

  private turn(dx: number, dy: number): void {
    this.orbit.turn -= dx * TURN_RAD;
    this.orbit.rise = clamp(this.orbit.rise + dy * TURN_RAD, -STEEPEST, STEEPEST);
    this.draw();
  }

  private zoom(factor: number): void {
    this.orbit.distance = clamp(this.orbit.distance / factor, 0.1, 8);
    this.draw();
  }

  private linked(): WebGLProgram {
    const { gl } = this;
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]] as const) {
      const shader = gl.createShader(kind)!;
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    gl.useProgram(program);
    return program;
  }

  private load(model: Model): void {
    const { gl } = this;
    this.attribute("position", model.positions, 3, gl.UNSIGNED_SHORT);
    if (model.uv) this.attribute("uv", model.uv, 2, gl.UNSIGNED_SHORT);
    if (model.colors) this.attribute("color", model.colors, 3, gl.UNSIGNED_BYTE);
    gl.vertexAttrib3f(gl.getAttribLocation(this.program, "color"), 0.48, 0.48, 0.48);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, model.faces, gl.STATIC_DRAW);
    gl.enable(gl.DEPTH_TEST);
    gl.clearColor(BACKGROUND, BACKGROUND, BACKGROUND, 1);
    this.packed.pages.forEach((page, number) => {
      this.textures[number] = null;
      if (page.image) void this.loadImage(number, page.image);
    });
  }

  private attribute(name: string, values: Uint16Array | Uint8Array, size: number, type: number): void {
    const { gl } = this;
    const place = gl.getAttribLocation(this.program, name);
    if (place < 0) return;
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, size, type, true, 0, 0);
  }

  private async loadImage(number: number, url: string): Promise<void> {
    const { gl } = this;
    const image = new Image();
    image.src = url;
    await image.decode();
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, gl.RGB, gl.UNSIGNED_BYTE, image);
    gl.generateMipmap(gl.TEXTURE_2D);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
    this.textures[number] = texture;
    this.draw();
  }

  /** Draw before the next frame. */
  draw(): void {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.drawNow();
    });
  }

  private drawNow(): void {
    const { gl, canvas, program } = this;
    const [w, h] = [canvas.clientWidth, canvas.clientHeight].map((px) => Math.max(1, Math.round(px * devicePixelRatio)));
    if (canvas.width !== w || canvas.height !== h) [canvas.width, canvas.height] = [w, h];
    gl.viewport(0, 0, w, h);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const matrix = clipFromModel(this.packed, this.orbit, w / h);
    gl.uniformMatrix4fv(gl.getUniformLocation(program, "clipFromModel"), false, matrix);
    this.packed.pages.forEach((page, number) => {
      const texture = this.textures[number];
      gl.uniform1i(gl.getUniformLocation(program, "textured"), texture ? 1 : 0);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.drawElements(gl.TRIANGLES, 3 * page.count, gl.UNSIGNED_INT, 12 * page.first);
    });
    canvas.dataset.drawn = "yes";
  }
}

/** Each wipe moves the edge between a photo and the model over it. */
function connectWipes(): void {
  for (const range of document.querySelectorAll<HTMLInputElement>(".wipe input")) {
    const set = () => range.parentElement!.style.setProperty("--wipe", `${range.value}%`);
    range.addEventListener("input", set);
    set();
  }
}

async function show(): Promise<void> {
  const source = document.getElementById("packed-model");
  const canvas = document.querySelector<HTMLCanvasElement>("#model");
  if (!source || !canvas) return;
  if (!("DecompressionStream" in window) || !document.createElement("canvas").getContext("webgl2")) return;
  const packed = JSON.parse(source.textContent) as Packed;
  const model = await unpacked(packed);
  canvas.closest("figure")!.hidden = false;
  new Viewer(canvas, packed, model).draw();
}

connectWipes();
void show();

// Small helpers for making elements.

type Child = Node | string;
type Props = Record<string, string | number | boolean | ((event: never) => void)>;

/** The element with an id that index.html is known to have. */
export function byId<T extends Element = HTMLElement>(id: string): T {
  return document.getElementById(id) as unknown as T;
}

/** An element; `on...` properties are listeners, others attributes (false = left out, except aria's). */
export function el<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  props: Props = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  assign(element, props);
  element.append(...children);
  return element;
}

/** The same for SVG. */
export function svg(tag: string, props: Props = {}, ...children: Child[]): SVGElement {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  assign(element, props);
  element.append(...children);
  return element;
}

function assign(element: Element, props: Props): void {
  for (const [name, value] of Object.entries(props)) {
    if (typeof value === "function") {
      element.addEventListener(name.slice(2).toLowerCase(), value as (event: Event) => void);
    } else if (value !== false || name.startsWith("aria-")) {
      element.setAttribute(name, String(value));
    }
  }
}

/** A labelled slider; `say` words its value. */
export function slider(
  name: string,
  range: { min: number; max: number; step: number; value: number },
  say: (value: number) => string,
  act: (value: number) => void,
): HTMLLabelElement {
  const output = el("output", {}, say(range.value));
  const input = el("input", {
    type: "range", ...range, "aria-label": name,
    oninput: () => {
      output.textContent = say(input.valueAsNumber);
      act(input.valueAsNumber);
    },
    ondblclick: () => {
      input.value = String(range.value);
      input.dispatchEvent(new Event("input"));
    },
  });
  input.value = String(range.value);
  return el("label", { class: "slider" }, el("span", {}, name), output, input);
}

/** Brightness of photos and colors, in stops. */
export function exposureSlider(value: number, act: (stops: number) => void): HTMLLabelElement {
  const say = (ev: number) => `${ev > 0 ? "+" : ""}${ev.toFixed(1)} EV`;
  return slider("Exposure", { min: -4, max: 4, step: 0.1, value }, say, act);
}

export function check(name: string, on: boolean, act: (on: boolean) => void): HTMLLabelElement {
  const input = el("input", { type: "checkbox", onchange: () => act(input.checked) });
  input.checked = on;
  return el("label", { class: "check" }, input, name);
}

export function section(title: string, ...children: Child[]): HTMLElement {
  return el("section", { "aria-label": title }, el("h3", {}, title), ...children);
}

/** Whether a key press belongs to a text field or slider rather than to the page. */
export function typing(event: KeyboardEvent): boolean {
  const target = event.target as HTMLElement;
  return target.matches("input:not([type=checkbox]), textarea, select") || target.closest("dialog") !== null;
}

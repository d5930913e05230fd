// The project's settings as a form; each change is written to project.toml at once.

import * as api from "./api.ts";
import { byId, el } from "./dom.ts";

type Value = api.SettingValue;

/** Opens the form. changed: called after a change was written. */
export async function showSettings(changed: () => void): Promise<void> {
  const form = new SettingsForm(await api.settings(), changed);
  form.draw();
  byId<HTMLDialogElement>("settings").showModal();
}

class SettingsForm {
  private problem = "";
  private readonly open = new Set(["color"]);

  constructor(private form: api.SettingsForm, private readonly changed: () => void) {}

  draw(): void {
    const dialog = byId<HTMLDialogElement>("settings");
    const scrolled = dialog.scrollTop;
    const focused = document.activeElement?.id;
    const close = el("form", { method: "dialog" }, el("button", { class: "main" }, "Close"));
    dialog.replaceChildren(
      el("h2", {}, "Settings of this project"),
      el("p", { class: "hint" }, "Each change is written to project.toml at once; comments in it stay."),
      el("p", { class: "verdict bad", role: "alert", hidden: !this.problem }, this.problem),
      ...this.form.tables.map((table) => this.table(table)),
      close,
    );
    dialog.scrollTop = scrolled;
    if (focused) document.getElementById(focused)?.focus({ preventScroll: true });
  }

  private table(table: api.SettingsTable): HTMLElement {
    const made = el(
      "details", { open: this.open.has(table.name) },
      el("summary", {}, el("b", {}, named(table.name)), el("span", { class: "hint" }, table.help)),
      ...table.options.map((option) => this.option(table.name, option)),
    );
    made.addEventListener("toggle", () => (made.open ? this.open.add(table.name) : this.open.delete(table.name)));
    return made;
  }

  private option(table: string, option: api.Setting): HTMLElement {
    const id = `setting-${table}-${option.key}`;
    const set = (value: Value) => void this.set(table, option.key, value);
    const reset = el("button", { type: "button", class: "quiet", "aria-label": `Default of ${named(option.key)}`, onclick: () => set(null) }, "Default");
    reset.hidden = !option.given;
    const label = option.kind === "several" ? el("span", { id: `${id}-label` }, named(option.key)) : el("label", { for: id }, named(option.key));
    return el(
      "div", { class: "setting", "data-setting": `${table}.${option.key}` },
      el("div", { class: "setting-head" }, label, control(id, option, set), reset),
      el("p", { class: "hint", id: `${id}-help` }, `${option.help} Default: ${worded(option.default)}.`),
    );
  }

  private async set(table: string, key: string, value: Value): Promise<void> {
    try {
      const answer = await api.changeSettings(this.form.version, [{ table, key, value }]);
      this.form = answer.form;
      this.problem = answer.conflict ? "project.toml was changed elsewhere; it is read again, change it once more." : "";
      this.changed();
    } catch (error) {
      this.problem = error instanceof Error ? error.message : String(error);
    }
    this.draw();
  }
}

const named = (name: string) => {
  const words = name.replaceAll(/[_-]/g, " ");
  return words.charAt(0).toUpperCase() + words.slice(1);
};

function worded(value: Value): string {
  if (typeof value === "boolean") return value ? "on" : "off";
  if (Array.isArray(value)) return value.join(", ");
  return value === null ? "none" : String(value);
}

function control(id: string, option: api.Setting, set: (value: Value) => void): HTMLElement {
  const help = { id, "aria-describedby": `${id}-help` };
  if (option.kind === "choice") {
    const options = option.choices!.map((choice) => el("option", { value: String(choice), selected: choice === option.value }, String(choice)));
    const made = el("select", { ...help, onchange: () => set(option.choices![made.selectedIndex]) }, ...options);
    return made;
  }
  if (option.kind === "flag") {
    const made = el("input", { ...help, type: "checkbox", onchange: () => set(made.checked) });
    made.checked = option.value === true;
    return made;
  }
  if (option.kind === "several") return several(id, option, set);
  if (option.kind === "place") return place(id, option, set);
  const number = option.kind !== "text";
  const made: HTMLInputElement = el("input", { ...help, type: number ? "number" : "text", onchange: () => set(entered(made, number)) });
  if (number) {
    made.step = option.kind === "integer" ? "1" : "any";
    made.min = String(option.least ?? "");
    made.max = String(option.most ?? "");
  }
  made.value = option.value === null ? "" : String(option.value);
  return made;
}

/** Three numbers; they count once all are there, and are the default once all are gone. */
function place(id: string, option: api.Setting, set: (value: Value) => void): HTMLElement {
  const now = (option.value as number[] | null) ?? [];
  const fields: HTMLInputElement[] = ["x", "y", "z"].map((axis, i) => {
    const field: HTMLInputElement = el("input", {
      type: "number", step: "any", id: i === 0 ? id : `${id}-${axis}`, "aria-label": `${named(option.key)}, ${axis}`, "aria-describedby": `${id}-help`,
      onchange: () => {
        const values = fields.map((other) => other.valueAsNumber);
        if (values.every(Number.isFinite)) set(values);
        else if (fields.every((other) => other.value === "")) set(null);
      },
    });
    field.value = now[i] === undefined ? "" : String(now[i]);
    return field;
  });
  return el("div", { class: "place" }, ...fields);
}

/** An emptied field is the default. */
function entered(input: HTMLInputElement, number: boolean): Value {
  if (input.value === "") return null;
  return number ? input.valueAsNumber : input.value;
}

function several(id: string, option: api.Setting, set: (value: Value) => void): HTMLElement {
  const chosen = new Set(option.value as string[]);
  const boxes = option.choices!.map((choice, i) => {
    const box = el("input", {
      type: "checkbox", id: i === 0 ? id : `${id}-${i}`,
      onchange: () => {
        if (box.checked) chosen.add(String(choice));
        else chosen.delete(String(choice));
        set(chosen.size ? option.choices!.map(String).filter((name) => chosen.has(name)) : null);
      },
    });
    box.checked = chosen.has(String(choice));
    return el("label", { class: "check" }, box, String(choice));
  });
  return el("div", { class: "several", role: "group", "aria-labelledby": `${id}-label` }, ...boxes);
}

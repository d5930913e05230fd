// The strip under the top bar (what went wrong, what was lost), and the job at its right.

import type { Job } from "./api.ts";
import { cancelJob } from "./api.ts";
import { byId, el } from "./dom.ts";

let running: Job | null = null;

/** Say a sentence until it is dismissed; an empty one takes it away. */
export function notice(sentence: string, kind: "warn" | "bad" = "warn", dismissable = true): void {
  const strip = byId("notice");
  strip.hidden = !sentence;
  strip.dataset.kind = kind;
  strip.replaceChildren(sentence);
  if (dismissable) strip.append(el("button", { type: "button", onclick: () => notice("") }, "Dismiss"));
}

/** Show how far a job is; finished ones disappear, failed ones say why. */
export function showJob(job: Job): void {
  const over = job.state === "done" || job.state === "failed" || job.state === "cancelled";
  if (over && running && running.id !== job.id) return;
  running = over ? null : job;
  byId("job").hidden = over;
  byId("job").dataset.state = job.state;
  if (over) {
    if (job.message && job.kind !== "layer") notice(`${job.title}: ${job.message}`, job.state === "failed" ? "bad" : "warn");
    return;
  }
  byId("job-title").textContent = job.item ? `${job.title} \u2013 ${job.item}` : job.title;
  const bar = byId<HTMLProgressElement>("job-progress");
  if (job.total > 0) bar.value = job.done / job.total;
  else bar.removeAttribute("value");
}

export function hideJob(): void {
  running = null;
  byId("job").hidden = true;
}

byId("job-cancel").addEventListener("click", () => {
  if (running) void cancelJob(running.id);
});

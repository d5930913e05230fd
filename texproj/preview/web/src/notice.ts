// The strip under the top bar (what went wrong, what was lost), and the job at its right.

import type { Job } from "./api.ts";
import { cancelJob } from "./api.ts";
import { byId, el } from "./dom.ts";
import { jobWords, MAKING } from "./jobwords.ts";

let running: Job | null = null;
/** Number of the last job that ended: what was said of it earlier may arrive later. */
let ended = 0;

/** The job that is shown. */
export const runningJob = () => running;

/** Say a sentence until it is dismissed; an empty one takes it away. */
export function notice(sentence: string, kind: "good" | "warn" | "bad" = "warn", dismissable = true): void {
  const strip = byId("notice");
  strip.hidden = !sentence;
  strip.dataset.kind = kind;
  strip.replaceChildren(sentence);
  if (dismissable) strip.append(el("button", { type: "button", onclick: () => notice("") }, "Dismiss"));
}

/** Show how far a job is; finished ones disappear, failed ones say why. */
export function showJob(job: Job): void {
  const over = job.state === "done" || job.state === "failed" || job.state === "cancelled";
  if (over) ended = Math.max(ended, job.id);
  else if (job.id <= ended) return;
  if (job.state === "waiting" && running) return;
  if (over && running && running.id !== job.id) return;
  running = over ? null : job;
  byId("job").hidden = over;
  byId("job").dataset.state = job.state;
  lockButtons();
  if (over) {
    if (job.state !== "done" && job.message) notice(`${job.title}: ${job.message}`, job.state === "failed" ? "bad" : "warn");
    return;
  }
  const words = jobWords(job);
  byId("job-title").textContent = words;
  byId("job-title").title = words;
  const bar = byId<HTMLProgressElement>("job-progress");
  if (job.total > 1) bar.value = job.done / job.total;
  else bar.removeAttribute("value");
  const stop = byId<HTMLButtonElement>("job-cancel");
  if (stop.dataset.job !== String(job.id)) {
    stop.dataset.job = String(job.id);
    stop.disabled = false;
    stop.textContent = "Stop";
  }
}

export function hideJob(): void {
  running = null;
  ended = 0;
  byId("job").hidden = true;
  lockButtons();
}

/** While the project is worked on, what would start more work says so and cannot be pressed. */
export function lockButtons(): void {
  const busy = running !== null && MAKING.includes(running.kind);
  for (const button of document.querySelectorAll<HTMLButtonElement>("button[data-starts]")) {
    button.disabled = busy || button.dataset.off === "true";
    const words = (button.dataset.words ??= button.textContent!);
    button.textContent = busy && button.dataset.starts === running!.kind ? button.dataset.busy! : words;
  }
}

byId("job-cancel").addEventListener("click", () => {
  if (!running) return;
  const stop = byId<HTMLButtonElement>("job-cancel");
  stop.disabled = true;
  stop.textContent = "Stopping\u2026";
  void cancelJob(running.id);
});

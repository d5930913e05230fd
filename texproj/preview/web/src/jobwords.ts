// What a job does, in words.

import type { Job } from "./api.ts";

/** Kinds of work that change the project; only one of them is started at a time. */
export const MAKING = ["run", "register", "color", "solve", "place", "appearance", "turntable"];

/** Those of them after which the model is shown. */
export const MADE = ["run", "place"];

const STAGES: Record<string, string> = {
  features: "looking for points in the photos",
  matching: "comparing photos with each other",
  placing: "placing the photos to each other",
  block: "placing all photos on the model",
  register: "finding the cameras",
  refine: "refining all cameras together",
  occluders: "looking for what stands in front",
  color: "coloring the model",
  report: "writing the report",
  appearance: "telling the light from the surface",
  turntable: "filming the model",
  "comparing photos": "comparing photos with each other",
};

/** How far a job is: "finding the cameras, photo 3 of 11, about 40 s left". */
export function jobWords(job: Job): string {
  if (job.state === "waiting") return `${job.title}: waits for its turn`;
  if (job.kind === "layer") return job.title;
  const stage = STAGES[job.stage] ?? job.stage;
  const parts = [stage, countWords(job), job.left_s === null ? "" : leftWords(job.left_s)];
  const far = parts.filter(Boolean).join(", ");
  return far ? `${job.title}: ${far}` : job.title;
}

function countWords({ stage, done, total }: Job): string {
  if (total < 2) return "";
  if (stage === "register" || stage === "features") return `photo ${Math.min(done + 1, total)} of ${total}`;
  if (stage === "refine") return `round ${Math.min(done + 1, total)} of at most ${total}`;
  return `${Math.round((done / total) * 100)} %`;
}

export function leftWords(seconds: number): string {
  if (seconds < 5) return "a few seconds left";
  if (seconds < 90) return `about ${Math.round(seconds / 5) * 5} s left`;
  return `about ${Math.round(seconds / 60)} min left`;
}

/** The title of the browser's tab while `job` works, and when nothing does. */
export function tabTitle(project: string, job: Job | null, done: boolean): string {
  const name = `${project} \u2013 texproj`;
  if (done) return `\u2713 ${name}`;
  if (!job || !MAKING.includes(job.kind)) return name;
  const part = job.total > 1 ? ` ${Math.round((job.done / job.total) * 100)} %` : "";
  return `\u2026${part} ${name}`;
}

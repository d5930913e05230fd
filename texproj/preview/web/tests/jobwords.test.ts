// A job says what it does, how far it is and how long it still takes, in words.

import assert from "node:assert/strict";
import { test } from "node:test";
import type { Job } from "../src/api.ts";
import { jobWords, leftWords, tabTitle } from "../src/jobwords.ts";

const JOB: Job = {
  id: 1, kind: "run", title: "Make the model", subject: "", state: "running",
  stage: "register", done: 2, total: 11, item: "a.jpg", left_s: 41, message: "",
};

test("stage, photo and time", () => {
  assert.equal(jobWords(JOB), "Make the model: finding the cameras, photo 3 of 11, about 40 s left");
  assert.equal(jobWords({ ...JOB, stage: "refine", done: 0, total: 1, item: "", left_s: null }),
    "Make the model: refining all cameras together");
  assert.equal(jobWords({ ...JOB, stage: "refine", done: 1, total: 10, item: "round 2", left_s: 40 }),
    "Make the model: refining all cameras together, round 2 of at most 10, about 40 s left");
  assert.equal(jobWords({ ...JOB, stage: "color", done: 5, total: 20, item: "", left_s: 300 }),
    "Make the model: coloring the model, 25 %, about 5 min left");
});

test("the last photo is not one too many", () => {
  assert.match(jobWords({ ...JOB, done: 11 }), /photo 11 of 11/);
});

test("waiting and looking", () => {
  assert.equal(jobWords({ ...JOB, state: "waiting" }), "Make the model: waits for its turn");
  assert.equal(jobWords({ ...JOB, kind: "layer", title: "Counting the photos" }), "Counting the photos");
});

test("times are rounded as a person would", () => {
  assert.deepEqual([2, 41, 89, 91, 3600].map(leftWords), [
    "a few seconds left", "about 40 s left", "about 90 s left", "about 2 min left", "about 60 min left",
  ]);
});

test("the tab tells that work goes on, how far it is, and that it is done", () => {
  assert.equal(tabTitle("stele", JOB, false), "\u2026 18 % stele \u2013 texproj");
  assert.equal(tabTitle("stele", { ...JOB, kind: "layer" }, false), "stele \u2013 texproj");
  assert.equal(tabTitle("stele", null, true), "\u2713 stele \u2013 texproj");
});

// Worst first, and where to begin to pick.

import assert from "node:assert/strict";
import { test } from "node:test";
import type { PhotoFacts } from "../src/api.ts";
import { listed, worstFirst } from "../src/photolist.ts";
import { photoToPick } from "../src/startcard.ts";

const photo = (name: string, status: PhotoFacts["status"], error?: number, picks = 0): PhotoFacts => ({
  name, status, advice: "", picks, expected_error_px: error,
});

test("broken, failed and unknown photos before registered ones, these by their error", () => {
  const photos = [photo("a", "registered", 0.4), photo("b", "registered", 3), photo("c", "none"), photo("d", "broken"), photo("e", "failed")];
  assert.deepEqual(worstFirst(photos).map((p) => p.name), ["d", "e", "c", "b", "a"]);
  assert.equal(photos[0].name, "a");
});

test("a choice lists by words, state and number; what has no number comes last", () => {
  const photos = [photo("IMG 10", "registered", 0.4), photo("IMG 9", "registered", 3), photo("b", "none"), photo("c", "excluded")];
  const names = (search: string, filter: "all" | "todo" | "out", order: "worst" | "name" | "error") =>
    listed(photos, { search, filter, order }).map((p) => p.name);
  assert.deepEqual(names("", "all", "name"), ["b", "c", "IMG 9", "IMG 10"]);
  assert.deepEqual(names("", "all", "error"), ["IMG 9", "IMG 10", "b", "c"]);
  assert.deepEqual(names("img 1", "all", "worst"), ["IMG 10"]);
  assert.deepEqual(names("", "out", "name"), ["c"]);
  assert.deepEqual(names("", "todo", "name"), ["b"]);
});

test("picking begins where picks are, else in the middle of the row", () => {
  const photos = ["a", "b", "c"].map((name) => photo(name, "none"));
  assert.equal(photoToPick(photos).name, "b");
  assert.equal(photoToPick([...photos, photo("d", "none", undefined, 2)]).name, "d");
});

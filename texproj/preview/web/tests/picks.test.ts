// Picks as values: what two editors meant, and undoing.

import assert from "node:assert/strict";
import { test } from "node:test";
import type { Pick } from "../src/picks.ts";
import { freeName, History, merged, pairs, put, without } from "../src/picks.ts";

const pick = (name: string, u: number): Pick => ({ name, uv: [u, 0], xyz: [u, 0, 0], normal: null });
const [a, b, c] = [pick("1", 1), pick("2", 2), pick("3", 3)];

test("both editors' new picks stay, and what one deleted is gone", () => {
  assert.deepEqual(merged([a], [a, b], [a, pick("9", 9)]).map((p) => p.name), ["1", "9", "2"]);
  assert.deepEqual(merged([a, b], [a], [a, b, c]).map((p) => p.name), ["1", "3"]);
  assert.deepEqual(merged([a, b], [a, b], [a]).map((p) => p.name), ["1"]);
});

test("two new picks of one name are both kept, mine renamed", () => {
  const found = merged([a], [a, pick("2", 20)], [a, pick("2", 30)]);
  assert.deepEqual(found.map((p) => [p.name, p.uv![0]]), [["1", 1], ["2", 30], ["3", 20]]);
});

test("the same change made by both is one change", () => {
  assert.deepEqual(merged([a], [pick("1", 5)], [pick("1", 5)]), [pick("1", 5)]);
});

test("only full pairs are saved, and names are the smallest free number", () => {
  assert.deepEqual(pairs([a, { ...b, xyz: null }]).map((p) => p.name), ["1"]);
  assert.equal(freeName([a, c]), "2");
  assert.equal(freeName([]), "1");
});

test("editing leaves the old list as it was", () => {
  const before = [a, b];
  assert.deepEqual(put(before, pick("1", 7)).map((p) => p.uv![0]), [7, 2]);
  assert.deepEqual(without(before, "1"), [b]);
  assert.deepEqual(before, [a, b]);
});

test("undo goes back through my steps alone; a new step forgets what was undone", () => {
  const history = new History();
  history.add([a]);
  history.add([a, b]);
  history.rebase((mine) => [...mine, c]);
  history.undo();
  assert.deepEqual(history.now, [a, c]);
  history.redo();
  assert.deepEqual(history.now, [a, b, c]);
  history.undo();
  history.add([c]);
  assert.ok(!history.canRedo);
});

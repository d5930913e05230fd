// How a model stands before anybody said so.

import assert from "node:assert/strict";
import { test } from "node:test";
import { AXES, axisOf, frontOf, guessedUp, vectorOf } from "../src/upright.ts";

/** A square of two faces that looks along +z. */
const SQUARE = { positions: [0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0], faces: [0, 1, 2, 0, 2, 3] };

test("an open surface has a front, whichever way it is wound", () => {
  assert.deepEqual(frontOf(SQUARE.positions, SQUARE.faces), [0, 0, 1]);
  assert.deepEqual(frontOf(SQUARE.positions, [...SQUARE.faces].reverse())!.map((v) => v + 0), [0, 0, -1]);
});

test("a closed surface has none", () => {
  const corners = [0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1];
  assert.equal(frontOf(corners, [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]), null);
  assert.equal(frontOf([], []), null);
});

test("a wall stands on z, a scan in a camera's frame on y, its way by what it faces", () => {
  assert.equal(guessedUp([0, -1, 0]), "z");
  assert.equal(guessedUp(null), "z");
  assert.equal(guessedUp([0, 0, 1]), "y");
  assert.equal(guessedUp([0.1, 0, -0.99]), "-y");
});

test("axes and their directions belong together", () => {
  for (const axis of AXES) assert.equal(axisOf(vectorOf(axis)), axis);
  assert.equal(axisOf([0.2, -0.9, 0.3]), "-y");
});

// Picks as values: editing makes new lists, so that undo is a matter of keeping old ones.

import type { SavedPick } from "./api.ts";
import type { Vec2, Vec3 } from "./lens.ts";

/** A pair, or half of one while the other side is still to be set. */
export interface Pick {
  name: string;
  uv: Vec2 | null;
  xyz: Vec3 | null;
  normal: Vec3 | null;
}

export type Picks = readonly Pick[];

export const isPair = (pick: Pick) => pick.uv !== null && pick.xyz !== null;

/** The full pairs, as they are saved. */
export function pairs(picks: Picks): SavedPick[] {
  return picks.filter(isPair).map(({ name, uv, xyz }) => ({ name, uv: uv!, xyz: xyz! }));
}

export function fromSaved(saved: SavedPick[]): Pick[] {
  return saved.map(({ name, uv, xyz, normal }) => ({ name, uv, xyz, normal: normal ?? null }));
}

/** The list with one pick changed, or added at the end. */
export function put(picks: Picks, pick: Pick): Picks {
  const known = picks.some((other) => other.name === pick.name);
  return known ? picks.map((other) => (other.name === pick.name ? pick : other)) : [...picks, pick];
}

export const without = (picks: Picks, name: string): Picks => picks.filter((pick) => pick.name !== name);

/** The smallest number that is not a name yet. */
export function freeName(picks: Picks): string {
  const names = new Set(picks.map((pick) => pick.name));
  let number = 1;
  while (names.has(String(number))) number++;
  return String(number);
}

export const same = (a: Pick | undefined, b: Pick | undefined) =>
  a === b || (a !== undefined && b !== undefined && String(a.uv) === String(b.uv) && String(a.xyz) === String(b.xyz));

/**
 * What two editors of the same list meant: whatever I changed since `base` is as I have it, all
 * else is as they have it. Two new picks of one name both stay, mine under a new name.
 */
export function merged(base: Picks, mine: Picks, theirs: Picks): Picks {
  const find = (list: Picks, name: string) => list.find((pick) => pick.name === name);
  let out: Picks = theirs.filter((t) => {
    const touched = !same(find(mine, t.name), find(base, t.name));
    return !touched || find(mine, t.name) !== undefined || find(base, t.name) === undefined;
  });
  for (const pick of mine) {
    const [before, other] = [find(base, pick.name), find(theirs, pick.name)];
    if (same(pick, before) || same(pick, other)) continue;
    const clash = before === undefined && other !== undefined;
    out = put(out, clash ? { ...pick, name: freeName([...out, ...mine]) } : pick);
  }
  return out;
}

/** The states of a list, and where in them one is. */
export class History {
  private states: Picks[] = [[]];
  private index = 0;

  get now(): Picks {
    return this.states[this.index];
  }

  reset(picks: Picks): void {
    this.states = [picks];
    this.index = 0;
  }

  /** A new state; what had been undone is forgotten. */
  add(picks: Picks): void {
    this.states = [...this.states.slice(0, this.index + 1), picks];
    this.index++;
  }

  /** Change the present state itself: news from elsewhere, or the middle of a drag. */
  amend(picks: Picks): void {
    this.states[this.index] = picks;
  }

  /** Change every state alike: so that undoing my steps does not undo what others did. */
  rebase(change: (picks: Picks) => Picks): void {
    this.states = this.states.map(change);
  }

  get canUndo(): boolean {
    return this.index > 0;
  }

  get canRedo(): boolean {
    return this.index < this.states.length - 1;
  }

  undo(): void {
    if (this.canUndo) this.index--;
  }

  redo(): void {
    if (this.canRedo) this.index++;
  }
}

"""The table of docs/benchmarks.md that tests/bench_all.py fills, and what README shows of it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

KEPT = Path(__file__).resolve().parent.parent / "docs" / "benchmarks.md"
BEGIN, END = "<!-- bench_all -->", "<!-- end of bench_all -->"
HEAD = ("scene", "step", "s", "CPU s", "MB", "result")
STEPS = ("new", "register", "refine", "color", "report")
"""What `texproj new` and the first `texproj run` do."""

Cells = tuple[str, ...]


def kept(text: str) -> dict[tuple[str, str], Cells]:
    """The rows of the table in a document, by scene and step."""
    inside = re.search(f"{BEGIN}(.*?){END}", text, re.DOTALL)
    lines = inside[1].strip().splitlines()[2:] if inside else []
    cells = [tuple(cell.strip() for cell in line.strip("|").split("|")) for line in lines]
    return {(row[0], row[1]): row for row in cells}


def with_rows(text: str, rows: Sequence[Cells]) -> str:
    """The document with these rows in its table, those of other scenes as they were."""
    every = {**kept(text), **{(row[0], row[1]): row for row in rows}}
    lines = [HEAD, ("---",) * len(HEAD), *every.values()]
    table = "\n".join(f"| {' | '.join(line)} |" for line in lines)
    return re.sub(f"{BEGIN}.*?{END}", f"{BEGIN}\n{table}\n{END}", text, flags=re.DOTALL)


def headline(text: str) -> list[Cells]:
    """A row for each scene: photos registered, pixels off, dB, processor seconds, megabytes."""
    rows = kept(text)
    found = []
    for scene in dict.fromkeys(scene for scene, _ in rows):
        steps = [rows[scene, step] for step in STEPS]
        count, off, _ = rows[scene, "refine"][5].split(", ")
        seconds = sum(float(step[3]) for step in steps)
        megabytes = max(int(step[4]) for step in steps)
        held_out = rows.get((scene, "held out"), ("",) * 6)[5]
        found.append((scene, count, off, held_out, f"{seconds:.0f}", str(megabytes)))
    return found

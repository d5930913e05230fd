"""Picks of photos that name points of the mesh, completed from a list of these points."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from texproj.errors import InputError
from texproj.formats.correspondences import read_pixels
from texproj.formats.picked_points import read_picked_points
from texproj.photo import Correspondences
from texproj.project import Project
from texproj.stages.outcomes import Tally

SUFFIX = ".pp"
NO_PIXELS = (
    "no photo has picks that name its points: write correspondences/STEM.csv for each photo, with"
    " columns u,v,name, and import it again"
)


@dataclass(frozen=True)
class PointsOutcome:
    """By photo how many of its picks got a point, the names that the list does not have, and why
    picks could not be used.
    """

    points: int
    found: dict[str, int]
    unknown: dict[str, tuple[str, ...]]
    failed: dict[str, str]

    @property
    def tally(self) -> Tally:
        without = [name for name, count in self.found.items() if not count]
        return Tally(
            len(without) + len(self.failed), len(self.found) + len(self.failed), "completed"
        )

    def lines(self) -> Iterator[str]:
        """For people."""
        for name, count in self.found.items():
            unknown = self.unknown.get(name, ())
            left = f"; not in the list, left out: {', '.join(unknown)}" if unknown else ""
            yield f"{name}: {count} picks of {self.points} points{left}"
        for name, reason in self.failed.items():
            yield f"{name}: FAILED: {reason}"

    def as_dict(self) -> dict[str, Any]:
        """For --json."""
        told = {"photos": self.found, "unknown": self.unknown, "failed": self.failed}
        return {"points": self.points, **told}


def import_points(project: Project, path: Path) -> PointsOutcome:
    """Write x, y, z of the named points into the picks of all photos; where a photo's picks have
    them already, those of the same name are put anew and the others stay. Picks that cannot be
    used stay as they are, and stop no others.

    Raises InputError for a broken list, and where no photo names a point of it; nothing is written
    then.
    """
    known = read_picked_points(path)
    made: dict[str, Correspondences] = {}
    unknown: dict[str, tuple[str, ...]] = {}
    failed: dict[str, str] = {}
    for name in project.photo_paths:
        try:
            file = project.correspondences_path(name)
            if file.is_file():
                made[name], unknown[name] = _completed(file, known)
        except InputError as error:
            failed[name] = str(error)
    if not any(len(picks) for picks in made.values()):
        raise InputError(next(iter(failed.values()), f"{path}: {NO_PIXELS}"))
    for name, picks in made.items():
        if len(picks):
            project.save_correspondences(name, picks)
    found = {name: len(picks) for name, picks in made.items()}
    unknown = {name: names for name, names in unknown.items() if names}
    return PointsOutcome(len(known), found, unknown, failed)


def _completed(file: Path, known: dict[str, Any]) -> tuple[Correspondences, tuple[str, ...]]:
    """The picks of a file with the points of their names, and names without a point."""
    xy, xyz, names = read_pixels(file)
    placed = np.array([known.get(name, at) for name, at in zip(names, xyz, strict=True)])
    placed = placed.reshape(-1, 3)
    good = np.isfinite(placed).all(axis=1)
    kept = tuple(name for name, one in zip(names, good, strict=True) if one)
    left = tuple(name for name, one in zip(names, good, strict=True) if not one)
    return Correspondences(xy[good], placed[good], kept), left

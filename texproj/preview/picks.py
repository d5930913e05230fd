"""Picks on disk with versions, so that two pages do not overwrite each other.

A version is the hash of the file's bytes: an edit from outside makes a new one, too.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from texproj.errors import InputError, TexprojError, UsageError
from texproj.files import content_hash
from texproj.formats.camera_bounds import MOST_TRANSLATION
from texproj.formats.correspondences import MOST_PIXELS
from texproj.photo import Correspondences
from texproj.project import Project

NO_FILE = "none"
MAX_PICKS = 2000
MAX_NAME = 64
MOST = MOST_TRANSLATION
"""Largest number that a pick, ray or camera may hold, mesh units or pixels."""


class VersionConflict(TexprojError):  # noqa: N818 - said as what happened
    """The file changed since the page read it."""


@dataclass(frozen=True, eq=False)
class SavedPicks:
    """What is on disk and its version."""

    version: str
    picks: Correspondences

    def as_dict(self) -> dict[str, Any]:
        """As the page reads it."""
        rows = zip(self.picks.names, self.picks.xy_px, self.picks.xyz_in_world, strict=True)
        items = [{"name": n, "uv": uv.tolist(), "xyz": xyz.tolist()} for n, uv, xyz in rows]
        return {"version": self.version, "picks": items}


def version_of(project: Project, photo: str) -> str:
    """The version of a photo's picks. Raises InputError for a file that cannot be read."""
    path = project.correspondences_path(photo)
    try:
        return content_hash(path.read_bytes())
    except (FileNotFoundError, NotADirectoryError):
        return NO_FILE
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from None


def load_picks(project: Project, photo: str) -> SavedPicks:
    """The picks on disk. Raises InputError for a broken file."""
    version = version_of(project, photo)
    picks = project.load_correspondences(photo)
    return SavedPicks(version, picks or Correspondences(np.empty((0, 2)), np.empty((0, 3))))


def save_picks(project: Project, photo: str, picks: Correspondences, base: str) -> SavedPicks:
    """Write picks that were edited from version `base`.

    Raises VersionConflict, and writes nothing, where the file is no longer that version.
    """
    if version_of(project, photo) != base:
        raise VersionConflict("the picks changed elsewhere; merge and save again")
    project.save_correspondences(photo, picks)
    return load_picks(project, photo)


def parse_picks(data: Any) -> Correspondences:
    """Picks as the page sends them. Raises UsageError for anything else."""
    if not isinstance(data, list) or len(data) > MAX_PICKS:
        raise UsageError(f"picks must be a list of at most {MAX_PICKS}")
    names = tuple(_name(item) for item in data)
    if len(set(names)) != len(names):
        raise UsageError("two picks have one name")
    uv = [numbers(item.get("uv"), 2) for item in data]
    xyz = [numbers(item.get("xyz"), 3) for item in data]
    if any(abs(value) > MOST_PIXELS for row in uv for value in row):
        raise UsageError(f"a pick lies more than {MOST_PIXELS:g} pixels from its photo's corner")
    return Correspondences(np.array(uv).reshape(-1, 2), np.array(xyz).reshape(-1, 3), names)


def parse_names(data: Any) -> frozenset[str]:
    """Names of picks as the page sends them. Raises UsageError for anything else."""
    good = isinstance(data, list) and len(data) <= MAX_PICKS
    if not good or not all(isinstance(name, str) and len(name) <= MAX_NAME for name in data):
        raise UsageError(f"expected a list of at most {MAX_PICKS} names of picks")
    return frozenset(data)


def _name(item: Any) -> str:
    name = item.get("name") if isinstance(item, dict) else None
    if not isinstance(name, str) or not 0 < len(name) <= MAX_NAME or not name.isprintable():
        raise UsageError(f"each pick needs a name of 1 to {MAX_NAME} letters")
    return name


def numbers(value: Any, count: int) -> list[float]:
    """`count` numbers of possible size. Raises UsageError for anything else."""
    good = isinstance(value, list) and len(value) == count
    if not good or not all(_is_number(v) for v in value):
        raise UsageError(f"expected {count} numbers between -{MOST:g} and {MOST:g}")
    return [float(v) for v in value]


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= MOST

"""What may leave the project folder for the browser: no line of a file that lies outside of it.

Links out of the folder are how `texproj new --link` brings in photos and meshes; these come out as
pictures and shapes. Texts behind links are not read at all.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from starlette.exceptions import HTTPException

from texproj.errors import InputError

OUTSIDE = "it is a link out of the project folder; put the file itself there"


def leaves(path: Path, root: Path) -> bool:
    """Whether `path` is outside of the folder `root`, by whatever links."""
    return not path.resolve().is_relative_to(root.resolve())


def inside(path: Path, root: Path) -> None:
    """Refuse a request for a path that leaves the project."""
    if leaves(path, root):
        raise HTTPException(403, "this file lies outside of the project folder")


def check_texts(root: Path) -> None:
    """Raise InputError where the settings or the cameras, which are quoted, lie outside."""
    _check([root / "project.toml", root / "cameras.json"], root)


def check_picks(root: Path) -> None:
    """Raise InputError where picks lie outside; whoever registers from them might quote them."""
    _check((root / "correspondences").glob("*"), root)


def _check(paths: Iterable[Path], root: Path) -> None:
    for path in paths:
        if path.is_symlink() and leaves(path, root):
            raise InputError(f"{path.relative_to(root)} is not read: {OUTSIDE}")

"""The photo of a color chart, if the settings name one."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from texproj.errors import InputError
from texproj.project import Project

if TYPE_CHECKING:
    from texproj.color.checker.fit import Checker


def checker_path(project: Project) -> Path | None:
    """The photo of the color chart: `checker` of the settings, relative to the project."""
    named = project.settings.color.checker
    return None if named is None else project.root / named


def checker_of(project: Project) -> Checker | None:
    """What the color chart says about color, None where the settings name none.

    Raises InputError for a photo that is not there, or without a chart that can be used.
    """
    path = checker_path(project)
    if path is None:
        return None
    if not path.is_file():
        raise InputError(f"no photo of a color chart at {path}; correct `checker` in [color]")
    from texproj.color.checker.fit import read_checker  # noqa: PLC0415 - slow to load
    from texproj.formats.photos import read_photo, read_photo_info  # noqa: PLC0415

    own = [name for name, photo in project.photo_paths.items() if photo.samefile(path)]
    largest_mp = project.settings.largest_photo_mp
    info, develop = read_photo_info(path, largest_mp), project.settings.develop
    photo = read_photo(path, info, largest_mp=largest_mp, develop=develop)
    return read_checker(photo, own[0] if own else None)

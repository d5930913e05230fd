"""The photo of a color chart, if the settings name one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from texproj.color.checker.apply import with_checker
from texproj.color.checker.fit import read_checker
from texproj.errors import InputError
from texproj.formats.photos import read_photo, read_photo_info
from texproj.options import ColorOptions
from texproj.project import Project


def checker_path(project: Project) -> Path | None:
    """The photo of the color chart: `checker` of the settings, relative to the project."""
    named = project.settings.color.checker
    return None if named is None else project.root / named


def color_options(project: Project, names: Sequence[str]) -> ColorOptions:
    """The options of color; with the color chart's correction, if there is one.

    names: the photos of the cameras, in their order. Raises InputError for a photo that is not
    there, or without a chart that can be used.
    """
    options = project.settings.color
    path = checker_path(project)
    if path is None:
        return options
    if not path.is_file():
        raise InputError(f"no photo of a color chart at {path}; correct `checker` in [color]")
    own = [n for n, name in enumerate(names) if project.photo_path(name).samefile(path)]
    photo = read_photo(path, read_photo_info(path))
    return with_checker(options, read_checker(photo, own[0] if own else None))

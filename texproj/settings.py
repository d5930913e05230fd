"""What a person writes in project.toml, checked key by key."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from texproj.errors import InputError, UsageError, nearest_name
from texproj.options import (
    ColorOptions,
    MutualInformationOptions,
    OutputOptions,
    PatchOptions,
    PointsOptions,
    PreviewOptions,
    RefineOptions,
    RegisterOptions,
    RenderOptions,
    SilhouetteOptions,
    StructureOptions,
    UnwrapOptions,
    options_from,
)

SECTIONS: dict[str, type] = {
    "render": RenderOptions,
    "register": RegisterOptions,
    "points": PointsOptions,
    "structure": StructureOptions,
    "mutual-information": MutualInformationOptions,
    "silhouette": SilhouetteOptions,
    "refine": RefineOptions,
    "color": ColorOptions,
    "unwrap": UnwrapOptions,
    "patches": PatchOptions,
    "output": OutputOptions,
    "preview": PreviewOptions,
}
"""Tables of project.toml and the options that each holds."""

DEFAULT_PHOTOS = "photos"


@dataclass(frozen=True)
class Settings:
    """The settings of a project.

    mesh: path of the mesh relative to the project, None = the one file in mesh/;
    photos: folder of the photos; exclude: names of photos in it that are left out of everything;
    sections: options by name of their table in project.toml.
    """

    mesh: str | None = None
    photos: str = DEFAULT_PHOTOS
    exclude: tuple[str, ...] = ()
    sections: Mapping[str, Any] = field(default_factory=dict)

    def options(self, name: str) -> Any:
        """The options of section `name`: those of project.toml, else the defaults."""
        return self.sections.get(name) or SECTIONS[name]()

    def with_options(self, name: str, options: Any) -> Settings:
        """The settings with another set of options for section `name`."""
        return replace(self, sections={**self.sections, name: options})


def read_settings(text: str, where: str) -> Settings:
    """Settings from the text of a project.toml.

    Raises InputError for broken TOML and UsageError for a key or value that cannot be; both
    name `where`, the key and the nearest known key.
    """
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{where} is not valid TOML: {error}") from None
    except (ValueError, RecursionError):
        raise InputError(f"{where}: a number is too long, or it is nested too deeply") from None
    known = ["mesh", "photos", "exclude", *SECTIONS]
    for key in data:
        if key not in known:
            raise UsageError(f"{where}: unknown key {key!r}{nearest_name(key, known)}")
    for key in ("mesh", "photos"):
        if key in data and not (isinstance(data[key], str) and data[key]):
            raise UsageError(f"{where}: {key} must be a path in quotes")
    exclude = data.get("exclude", [])
    if not (isinstance(exclude, list) and all(isinstance(name, str) for name in exclude)):
        raise UsageError(f'{where}: exclude must be a list of photos: exclude = ["IMG_0007.jpg"]')
    sections: dict[str, Any] = {}
    for name, cls in SECTIONS.items():
        table = data.get(name, {})
        if not isinstance(table, dict):
            raise UsageError(
                f"{where}: {name} must be a table: write [{name}] on a line of its own"
            )
        sections[name] = options_from(cls, table, f"{where} [{name}]")
    return Settings(data.get("mesh"), data.get("photos", DEFAULT_PHOTOS), tuple(exclude), sections)

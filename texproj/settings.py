"""What a person writes in project.toml, checked key by key."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field, is_dataclass, replace
from typing import Any, get_type_hints

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

DEFAULT_PHOTOS = "photos"


@dataclass(frozen=True)
class Settings:
    """The settings of a project: one field for each table of project.toml.

    mesh: path of the mesh relative to the project, None = the one file in mesh/;
    photos: folder of the photos.
    """

    mesh: str | None = None
    photos: str = DEFAULT_PHOTOS
    render: RenderOptions = field(default_factory=RenderOptions)
    register: RegisterOptions = field(default_factory=RegisterOptions)
    points: PointsOptions = field(default_factory=PointsOptions)
    structure: StructureOptions = field(default_factory=StructureOptions)
    mutual_information: MutualInformationOptions = field(default_factory=MutualInformationOptions)
    silhouette: SilhouetteOptions = field(default_factory=SilhouetteOptions)
    refine: RefineOptions = field(default_factory=RefineOptions)
    color: ColorOptions = field(default_factory=ColorOptions)
    unwrap: UnwrapOptions = field(default_factory=UnwrapOptions)
    patches: PatchOptions = field(default_factory=PatchOptions)
    output: OutputOptions = field(default_factory=OutputOptions)
    preview: PreviewOptions = field(default_factory=PreviewOptions)

    def table(self, name: str) -> Any:
        """The options of a table of project.toml, by the name that it has there."""
        return getattr(self, _field_of(name))

    def with_table(self, name: str, options: Any) -> Settings:
        """The settings with other options for a table."""
        return replace(self, **{_field_of(name): options})


def _field_of(table: str) -> str:
    return table.replace("-", "_")


SECTIONS: dict[str, Any] = {
    name.replace("_", "-"): cls
    for name, cls in get_type_hints(Settings).items()
    if is_dataclass(cls)
}
"""Tables of project.toml and the options that each holds."""


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
    known = ["mesh", "photos", *SECTIONS]
    for key in data:
        if key not in known:
            raise UsageError(f"{where}: unknown key {key!r}{nearest_name(key, known)}")
    for key in ("mesh", "photos"):
        if key in data and not (isinstance(data[key], str) and data[key]):
            raise UsageError(f"{where}: {key} must be a path in quotes")
    tables: dict[str, Any] = {}
    for name, cls in SECTIONS.items():
        table = data.get(name, {})
        if not isinstance(table, dict):
            raise UsageError(
                f"{where}: {name} must be a table: write [{name}] on a line of its own"
            )
        tables[_field_of(name)] = options_from(cls, table, f"{where} [{name}]")
    return Settings(data.get("mesh"), data.get("photos", DEFAULT_PHOTOS), **tables)

"""What a person writes in project.toml, checked key by key."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any, get_type_hints

from texproj.errors import InputError, UsageError, excerpt, nearest_name
from texproj.options import (
    ColorOptions,
    DevelopOptions,
    LightOptions,
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
from texproj.photo import LARGEST_PHOTO_MP

DEFAULT_PHOTOS = "photos"
MOST_MEGAPIXELS = 1_000
"""Beyond, OpenCV refuses, whatever is set."""
NO_KEY = {"key": False}
"""Of a field that follows from the keys of the file."""
LONGEST_NAME = 255
"""Bytes of a file's name on every system."""


@dataclass(frozen=True)
class Settings:
    """The settings of a project: one field for each table of project.toml.

    mesh: path of the mesh relative to the project, None = the one file in mesh/;
    photos: folder of the photos; exclude: names of photos in it that are left out of everything;
    largest_photo_mp: million pixels of the largest photo or mask
    that is read. stands: the scan's upward axis where [output] up names one, None where nobody did.
    """

    mesh: str | None = None
    photos: str = DEFAULT_PHOTOS
    exclude: tuple[str, ...] = ()
    largest_photo_mp: float = LARGEST_PHOTO_MP
    develop: DevelopOptions = field(default_factory=DevelopOptions)
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
    light: LightOptions = field(default_factory=LightOptions)
    output: OutputOptions = field(default_factory=OutputOptions)
    preview: PreviewOptions = field(default_factory=PreviewOptions)
    stands: str | None = field(default=None, metadata=NO_KEY)

    def table(self, name: str) -> Any:
        """The options of a table of project.toml, by the name that it has there."""
        return getattr(self, _field_of(name))

    def with_table(self, name: str, options: Any) -> Settings:
        """The settings with other options for a table."""
        return replace(self, **{_field_of(name): options})


def _field_of(table: str) -> str:
    return table.replace("-", "_")


def _table_of(field_name: str) -> str:
    return field_name.replace("_", "-")


SECTIONS: dict[str, Any] = {
    _table_of(name): cls for name, cls in get_type_hints(Settings).items() if is_dataclass(cls)
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
    keys = [f.name for f in fields(Settings) if f.metadata.get("key", True)]
    known = [key for key in keys if _table_of(key) not in SECTIONS] + [*SECTIONS]
    for key in data:
        if key not in known:
            raise UsageError(f"{where}: unknown key {excerpt(key)!r}{nearest_name(key, known)}")
    top: dict[str, Any] = {
        key: _path(data[key], f"{where}: {key}") for key in ("mesh", "photos") if key in data
    }
    if "exclude" in data:
        top["exclude"] = _names(data["exclude"], f"{where}: exclude")
    if "largest_photo_mp" in data:
        top["largest_photo_mp"] = _megapixels(data["largest_photo_mp"], where)
    tables: dict[str, Any] = {}
    for name, cls in SECTIONS.items():
        table = data.get(name, {})
        if not isinstance(table, dict):
            raise UsageError(
                f"{where}: {name} must be a table: write [{name}] on a line of its own"
            )
        tables[_field_of(name)] = options_from(cls, table, f"{where} [{name}]")
    up = tables["output"].up if "up" in data.get("output", {}) else "auto"
    return Settings(**top, **tables, stands=None if up == "auto" else up)


def _path(value: Any, where: str) -> str:
    if not (isinstance(value, str) and value):
        raise UsageError(f"{where} must be a path in quotes")
    if "\0" in value or max(len(part.encode()) for part in value.split("/")) > LONGEST_NAME:
        raise UsageError(f"{where} = {excerpt(value)!r} is no path that a file can have")
    return value


def _names(value: Any, where: str) -> tuple[str, ...]:
    if not (isinstance(value, list) and all(isinstance(name, str) for name in value)):
        raise UsageError(f'{where} must be a list of photos, such as ["IMG_0007.jpg"]')
    return tuple(value)


def _megapixels(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise UsageError(f"{where}: largest_photo_mp must be a number of million pixels")
    if not 0 < value <= MOST_MEGAPIXELS:
        raise UsageError(
            f"{where}: largest_photo_mp = {excerpt(value)}: more than 0 and at most"
            f" {MOST_MEGAPIXELS} million pixels can be read"
        )
    return float(value)

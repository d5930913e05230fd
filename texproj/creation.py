"""Making a project folder of what a person has: a mesh, and photos wherever they lie."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

from texproj.errors import InputError, OutputError, TexprojError, UsageError
from texproj.files import link_or_copy, write_atomically
from texproj.formats.meshes import MESH_SUFFIXES, read_mesh
from texproj.formats.meshes.companions import companions
from texproj.formats.photos import PHOTO_SUFFIXES, RAW_SUFFIXES, SAID, read_photo, read_photo_info
from texproj.intake import (
    find_photos,
    folders_of_photos,
    one_per_shot,
    refuse_same_stems,
    shown,
    unusable_name,
)
from texproj.options import DevelopOptions
from texproj.project import SETTINGS_FILE, Project
from texproj.repair import repair

Tell = Callable[[str], None]

NEW_SETTINGS = """\
# Settings of this project. Every key is optional; `texproj COMMAND --help` lists most of them, and
# docs/settings.md all. To leave photos out: exclude = ["IMG_0007.jpg"] (here, above any [table]).
mesh = {mesh}
photos = "photos"

[output]
up = "auto"  # a glb stands upright in viewers: upward in the photos, or x, -x, y, -y, z, -z
"""

LOOKED_AT_PX = 256
"""Longer side at which photos are decoded to see whether they are whole: jpegs take a tenth of the
time then."""


def _silent(_: str) -> None:
    pass


def create_project(
    root: Path, mesh: Path, photos: Sequence[Path], link: bool, tell: Tell = _silent
) -> Project:
    """Make a project folder of one mesh and photos (files, or folders that hold them).

    Files are copied, or linked if asked. Photos that lie one folder down are taken if there are
    none in the folder itself. `tell` gets a sentence for what is passed over, and for each photo
    that is damaged, which is taken all the same. Raises UsageError for a folder that is not empty,
    InputError for what cannot be used, OutputError for a place that cannot be written.
    """
    if root.exists() and (not root.is_dir() or any(root.iterdir())):
        raise UsageError(f"{root} exists and is not empty; give a new folder")
    _check_mesh(mesh)
    sources = _photo_sources(photos, tell)
    _check_photos(sources, tell)
    existed = root.exists()
    try:
        _fill(root, mesh, sources, link)
    except TexprojError:
        for made in root.iterdir() if existed else [root]:
            shutil.rmtree(made, ignore_errors=True)
        raise
    return Project.open(root)


def _check_mesh(mesh: Path) -> None:
    if not mesh.is_file():
        raise InputError(f"no mesh at {mesh}")
    if mesh.suffix.lower() not in MESH_SUFFIXES:
        kinds = ", ".join(s[1:] for s in MESH_SUFFIXES)
        raise InputError(f"{mesh} is not a mesh that texproj reads ({kinds})")
    why = unusable_name(mesh.name)
    if why:
        raise InputError(f"{shown(mesh)}: {why}; rename it")
    try:
        repair(*read_mesh(mesh))
    except InputError as error:
        reason = str(error)
        raise InputError(reason if str(mesh) in reason else f"{mesh}: {reason}") from None


def _photo_sources(photos: Sequence[Path], tell: Tell) -> list[Path]:
    sources: dict[str, Path] = {}
    for given in photos:
        for path in _given(given, tell):
            if path.name in sources:
                raise InputError(f"two photos are named {path.name}: rename one of them")
            sources[path.name] = path
    if not sources:
        raise UsageError("give at least one photo, or a folder of photos")
    kept = one_per_shot(sources, RAW_SUFFIXES, DevelopOptions().pair)
    for note in kept.notes:
        tell(note)
    refuse_same_stems(kept.paths.values())
    return list(sources.values())


def _given(place: Path, tell: Tell) -> list[Path]:
    """The photos at a place that was named: one file, or those of a folder."""
    if not place.exists():
        raise InputError(f"no photo or folder at {place}")
    if place.is_dir():
        found = _photos_in(place, tell)
        if not found:
            raise InputError(f"no photos in {place} ({SAID})")
        return found
    why = unusable_name(place.name)
    if why:
        raise InputError(f"{shown(place)}: {why}; rename it")
    if place.suffix.lower() not in PHOTO_SUFFIXES:
        raise InputError(f"{place} is not a photo that texproj reads ({SAID})")
    return [place]


def _photos_in(folder: Path, tell: Tell) -> list[Path]:
    """The photos of a folder; those of its folders if there are none, as in a camera's DCIM."""
    here = find_photos(folder, PHOTO_SUFFIXES)
    inside = folders_of_photos(folder, PHOTO_SUFFIXES)
    holding = {place: found for place, found in inside.items() if found.paths}
    for note in here.notes:
        tell(note)
    names = ", ".join(shown(place) for place in holding)
    if here.paths:
        if holding:
            tell(f"photos in {names} are not taken; give that folder too if they belong here")
        return list(here.paths.values())
    for found in inside.values():
        for note in found.notes:
            tell(note)
    if holding:
        tell(f"photos are taken from {names}")
    return [path for found in holding.values() for path in found.paths.values()]


def _check_photos(sources: Sequence[Path], tell: Tell) -> None:
    """Tell of each photo that cannot be read. Raises InputError if none can."""
    broken = []
    for path in sources:
        try:
            read_photo(path, read_photo_info(path), longest=LOOKED_AT_PX)
        except InputError as error:
            broken.append(str(error))
    if len(broken) == len(sources):
        raise InputError(f"no photo can be used: {broken[0]}")
    for reason in broken:
        tell(f"{reason}; it is taken, and will fail until it is replaced")


def write_settings(root: Path, mesh: str, more: str = "") -> None:
    """The project.toml of a new project; mesh: the name of a file in mesh/; more: lines after all
    others. Raises OutputError.
    """
    place = json.dumps(f"mesh/{mesh}", ensure_ascii=False)  # a string of TOML too
    write_atomically(root / SETTINGS_FILE, NEW_SETTINGS.format(mesh=place) + more)


def _fill(root: Path, mesh: Path, sources: Sequence[Path], link: bool) -> None:
    try:
        for folder in ("mesh", "photos", "masks", "correspondences"):
            (root / folder).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot make {root}: {error.strerror}") from None
    link_or_copy(mesh, root / "mesh" / mesh.name, link)
    for name, path in companions(mesh).items():
        beside = root / "mesh" / (Path(name).name if ".." in Path(name).parts else name)
        if not beside.exists():
            beside.parent.mkdir(parents=True, exist_ok=True)
            link_or_copy(path, beside, link)
    for source in sources:
        link_or_copy(source, root / "photos" / source.name, link)
    write_settings(root, mesh.name)

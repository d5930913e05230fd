"""The files that belong to a mesh file: buffers, materials, images."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from urllib.parse import unquote

from texproj.errors import InputError
from texproj.formats.documents import json_of, read_bytes, read_lines
from texproj.formats.foreign import Broken
from texproj.formats.meshes.mtl import FIRST_TILE, TILES, beside, image_names
from texproj.formats.meshes.ply import LONGEST_HEADER, ply_header
from texproj.formats.meshes.ply_layout import ply_images

MOST_BYTES = 1 << 30
"""Of a text that names other files; a larger one is taken to name none."""


def companions(path: Path) -> dict[str, Path]:
    """The files that an obj, gltf or ply names and that are there, by the name that it gives them,
    relative to its folder. A file that cannot be read names none.
    """
    try:
        names = _NAMES.get(path.suffix.lower(), lambda _: [])(path)
    except (InputError, Broken):
        return {}
    found = {name: file for name in names if (file := beside(path, name)) is not None}
    return dict(sorted(found.items()))


def _of_gltf(path: Path) -> list[str]:
    content = json_of(read_bytes(path, MOST_BYTES), f"{path}")
    entries: list[Any] = []
    for key in ("buffers", "images"):
        listed = content.get(key) if isinstance(content, dict) else None
        entries += listed if isinstance(listed, list) else []
    uris = [entry.get("uri") for entry in entries if isinstance(entry, dict)]
    return [unquote(uri) for uri in uris if isinstance(uri, str) and not uri.startswith("data:")]


def _of_obj(path: Path) -> list[str]:
    names = []
    for library in _libraries(path):
        names.append(library)
        file = beside(path, library)
        for image in image_names(read_lines(file, MOST_BYTES)) if file is not None else ():
            names += _tiles(path, image) if TILES in image else [image]
    return names


def _of_ply(path: Path) -> list[str]:
    with path.open("rb") as file:
        return ply_images(ply_header(file.read(LONGEST_HEADER)))


_NAMES = {".obj": _of_obj, ".gltf": _of_gltf, ".ply": _of_ply}


def _libraries(path: Path) -> list[str]:
    """The materials' files, which an obj names before they are used."""
    found = []
    with path.open("rb") as file:
        for line in file:
            words = line.split(None, 1)
            if words[:1] == [b"mtllib"] and len(words) == 2:
                found.append(words[1].decode("utf-8", "replace").strip())
            elif words[:1] in ([b"f"], [b"usemtl"]):
                break
    return found


def _tiles(path: Path, image: str) -> list[str]:
    """The images of all tiles that are there."""
    first = beside(path, image.replace(TILES, FIRST_TILE))
    if first is None:
        return []
    before, _, after = Path(image).name.partition(TILES)
    folder = Path(image).parent
    return [(folder / p.name).as_posix() for p in first.parent.glob(f"{before}[12]???{after}")]

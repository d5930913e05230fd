"""What the pages of a texture are called: as materials, and in the names of their files."""

from __future__ import annotations

import re

from texproj.formats.models.images import numbered
from texproj.mesh import TexturedMesh

UNTEXTURED = "untextured"
"""Material of faces that are on no page."""

_OTHER_CHARACTERS = re.compile(r"[^A-Za-z0-9._-]+")
LONGEST_NAME = 80


def page_names(model: TexturedMesh) -> tuple[str, ...]:
    """A name for each page: that of the mesh's own material, on one line, where it is kept."""
    if model.parts is None:
        return tuple(f"page_{i}" for i in range(len(model.pages)))
    return tuple(
        " ".join(name.split()) or f"page_{i}" for i, name in enumerate(model.parts.page_names)
    )


def file_endings(model: TexturedMesh) -> tuple[str, ...]:
    """What the files of the pages have after the model's name: their number, or the name of the
    mesh's own material in letters that every file system takes.
    """
    if model.parts is None:
        return numbered(len(model.pages))
    out: list[str] = []
    for number, name in enumerate(page_names(model)):
        ending = "_" + _OTHER_CHARACTERS.sub("_", name)[-LONGEST_NAME:].strip("._")
        while ending == "_" or ending.lower() in (other.lower() for other in out):
            ending += f"_{number}"
        out.append(ending)
    return tuple(out)

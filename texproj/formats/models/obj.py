"""OBJ with MTL and images, one material per page of the texture."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from texproj.formats.models.text import Text, decimals, integers, lines
from texproj.mesh import TexturedMesh

RELATIVE_DIGITS = 9
"""Digits of a coordinate below the diagonal of the bounding box: beyond single precision."""

UV_DIGITS = 7
"""A hundredth of a texel on the largest page."""

NORMAL_DIGITS = 6

BLOCK = 1 << 14
"""Lines that are made at once: they fit the processor's cache."""


def write_obj(
    path: Path,
    model: TexturedMesh,
    images: Sequence[Path],
    comments: Sequence[str] = (),
    gloss: Sequence[tuple[Path, Path]] = (),
) -> list[Path]:
    """Write `path` and its .mtl beside it; returns both.

    images: the files of the pages, in the same folder. Faces are grouped by page, in their order
    within each. comments: lines at the head of both; gloss: of each page the files of roughness and
    metallic, for the keys that Blender and others read for physically based materials. Raises
    OSError.
    """
    materials = path.with_suffix(".mtl")
    untextured = bool((model.page_of_face < 0).any())
    head = "".join(f"# {' '.join(line.split())}\n" for line in comments)
    maps = [f"map_Pr {r.name}\nmap_Pm {m.name}\n" for r, m in gloss] or [""] * len(images)
    text = _mtl([file.name for file in images], maps, untextured)
    materials.write_text(head + text, "utf-8")
    with path.open("wb") as out:
        out.write(head.encode())
        out.write(f"mtllib {materials.name}\n".encode())
        out.writelines(_columns(b"v", model.vertices, _coordinate_digits(model.vertices)))
        out.writelines(_columns(b"vt", model.uv, UV_DIGITS))
        if model.normals is not None:
            out.writelines(_columns(b"vn", model.normals, NORMAL_DIGITS))
        numbers = integers(np.arange(1, max(len(model.vertices), len(model.uv)) + 1))
        for page in np.unique(model.page_of_face):
            out.write(f"usemtl {_material(int(page))}\n".encode())
            out.writelines(_faces(model, page, numbers))
    return [path, materials]


def _material(page: int) -> str:
    return f"page_{page}" if page >= 0 else "untextured"


def _mtl(images: list[str], maps: list[str], untextured: bool) -> str:
    """Materials that shine by nothing but their texture and maps."""
    look = "Ka 1 1 1\nKd 1 1 1\nKs 0 0 0\nd 1\nillum 1\n"
    blocks = [
        f"newmtl {_material(i)}\n{look}map_Kd {image}\n{extra}"
        for i, (image, extra) in enumerate(zip(images, maps, strict=True))
    ]
    if untextured:
        blocks.append(f"newmtl {_material(-1)}\n{look.replace('Kd 1 1 1', 'Kd .5 .5 .5')}")
    return "\n".join(blocks)


def _coordinate_digits(vertices: NDArray[np.float64]) -> int:
    diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0))) or 1.0
    return max(1, RELATIVE_DIGITS - math.floor(math.log10(diagonal)))


def _columns(word: bytes, values: NDArray[np.float64], digits: int) -> Iterator[bytes]:
    for start in range(0, len(values), BLOCK):
        parts: list[bytes | Text] = [word]
        for column in values[start : start + BLOCK].T:
            parts += [b" ", decimals(column, digits)]
        yield lines([*parts, b"\n"])


def _faces(model: TexturedMesh, page: int, numbers: Text) -> Iterator[bytes]:
    """`f` lines of one page: vertex, texture vertex (if textured), normal (if any), from 1."""
    on_page = np.flatnonzero(model.page_of_face == page)
    for start in range(0, len(on_page), BLOCK):
        rows = on_page[start : start + BLOCK]
        faces, uv_faces = model.faces[rows], model.uv_faces[rows]
        parts: list[bytes | Text] = [b"f"]
        for corner in range(3):
            vertex = numbers[faces[:, corner]]
            parts += [b" ", vertex]
            if page >= 0:
                parts += [b"/", numbers[uv_faces[:, corner]]]
            if model.normals is not None:
                parts += [b"/" if page >= 0 else b"//", vertex]
        yield lines([*parts, b"\n"])

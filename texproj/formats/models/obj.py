"""OBJ with MTL and images, one material per page of the texture."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from texproj.formats.models.page_names import UNTEXTURED, page_names
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

    images: the files of the pages, in the same folder, then those of the model's normal map if
    there are any. Faces are grouped by the model's own parts, if it keeps them, then by page, in
    their order within each. comments: lines at the head of both; gloss: of each page the files of
    roughness and metallic, for the keys that Blender and others read for physically based
    materials. Raises OSError.
    """
    materials = path.with_suffix(".mtl")
    names = (*page_names(model), UNTEXTURED)  # the last is that of page -1
    untextured = bool((model.page_of_face < 0).any())
    head = "".join(f"# {' '.join(line.split())}\n" for line in comments)
    maps = [f"map_Pr {r.name}\nmap_Pm {m.name}\n" for r, m in gloss] or [""] * len(images)
    text = _mtl(names, [file.name for file in images], maps, untextured)
    materials.write_text(head + text, "utf-8")
    with path.open("wb") as out:
        out.write(head.encode())
        out.write(f"mtllib {materials.name}\n".encode())
        out.writelines(_columns(b"v", model.vertices, _coordinate_digits(model.vertices)))
        out.writelines(
            _columns(b"vt", model.uv, UV_DIGITS) if model.parts is None else _exact(model.uv)
        )
        if model.normals is not None:
            out.writelines(_columns(b"vn", model.normals, NORMAL_DIGITS))
        numbers = integers(np.arange(1, max(len(model.vertices), len(model.uv)) + 1))
        for part, rows in _parts(model):
            if part:
                out.write(f"o {part}\n".encode())
            for page in np.unique(model.page_of_face[rows]).tolist():
                out.write(f"usemtl {names[page]}\n".encode())
                chosen = rows[model.page_of_face[rows] == page]
                out.writelines(_faces(model, chosen, page >= 0, numbers))
    return [path, materials]


def _parts(model: TexturedMesh) -> Iterator[tuple[str, NDArray[np.intp]]]:
    """The name of each part and its faces; one without a name where the model keeps none."""
    if model.parts is None:
        yield "", np.arange(len(model.faces))
        return
    for number, node in enumerate(model.parts.nodes):
        rows = np.flatnonzero(model.parts.node_of_face == number)
        if len(rows):
            yield " ".join(node.name.split()) or f"part_{number}", rows


def _exact(uv: NDArray[np.float64]) -> Iterator[bytes]:
    """Texture vertices with all their digits: those of the mesh's own file."""
    for start in range(0, len(uv), BLOCK):
        rows = uv[start : start + BLOCK].tolist()
        yield "".join(f"vt {u!r} {v!r}\n" for u, v in rows).encode()


def _mtl(names: Sequence[str], images: list[str], maps: list[str], untextured: bool) -> str:
    """Materials that shine by nothing but their texture and maps. names: those of the pages, and
    one; images: of the pages, then maybe of their normal maps.
    """
    look = "Ka 1 1 1\nKd 1 1 1\nKs 0 0 0\nd 1\nillum 1\n"
    pages = len(names) - 1
    bumps = [f"norm {image}\n" for image in images[pages:]] or [""] * pages
    blocks = [
        f"newmtl {name}\n{look}map_Kd {image}\n{extra}{bump}"
        for name, image, extra, bump in zip(names, images, maps, bumps, strict=False)
    ]
    if untextured:
        blocks.append(f"newmtl {UNTEXTURED}\n{look.replace('Kd 1 1 1', 'Kd .5 .5 .5')}")
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


def _faces(
    model: TexturedMesh, chosen: NDArray[np.intp], textured: bool, numbers: Text
) -> Iterator[bytes]:
    """`f` lines of chosen faces: vertex, texture vertex (if textured), normal (if any), from 1."""
    for start in range(0, len(chosen), BLOCK):
        rows = chosen[start : start + BLOCK]
        faces, uv_faces = model.faces[rows], model.uv_faces[rows]
        parts: list[bytes | Text] = [b"f"]
        for corner in range(3):
            vertex = numbers[faces[:, corner]]
            parts += [b" ", vertex]
            if textured:
                parts += [b"/", numbers[uv_faces[:, corner]]]
            if model.normals is not None:
                parts += [b"/" if textured else b"//", vertex]
        yield lines([*parts, b"\n"])

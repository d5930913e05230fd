"""OBJ with MTL and images, one material per page of the texture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.formats.models.images import IMAGE_SUFFIXES, ImageFormat, encode_pages
from texproj.mesh import TexturedMesh

RELATIVE_DIGITS = 9
"""Digits of a coordinate below the diagonal of the bounding box: beyond single precision."""

UV_FORMAT = "%.7f"
"""A hundredth of a texel on the largest page."""


def write_obj(
    path: Path,
    model: TexturedMesh,
    image_format: ImageFormat = "png",
    images: Sequence[bytes] | None = None,
) -> list[Path]:
    """Write `path`, its .mtl and an image per page beside it; returns all files.

    Faces are grouped by page, in their order within each. images: the pages where they are
    encoded as `image_format` already (`encode_pages`). Raises OSError.
    """
    encoded = encode_pages(model.pages, image_format) if images is None else images
    suffix = IMAGE_SUFFIXES[image_format]
    files = [path.with_name(f"{path.stem}_{i}{suffix}") for i in range(len(model.pages))]
    for file, data in zip(files, encoded, strict=True):
        file.write_bytes(data)
    materials = path.with_suffix(".mtl")
    untextured = bool((model.page_of_face < 0).any())
    materials.write_text(_mtl([file.name for file in files], untextured), "utf-8")
    with path.open("w", encoding="utf-8", newline="\n") as out:
        out.write(f"mtllib {materials.name}\n")
        out.write(_lines(f"v {_per_row(_coordinate_format(model.vertices))}", model.vertices))
        out.write(_lines(f"vt {UV_FORMAT} {UV_FORMAT}", model.uv))
        if model.normals is not None:
            out.write(_lines(f"vn {_per_row('%.6f')}", model.normals))
        for page in np.unique(model.page_of_face):
            out.write(f"usemtl {_material(int(page))}\n")
            out.write(_faces(model, page))
    return [path, materials, *files]


def _material(page: int) -> str:
    return f"page_{page}" if page >= 0 else "untextured"


def _mtl(images: list[str], untextured: bool) -> str:
    """Materials that shine by nothing but their texture."""
    look = "Ka 1 1 1\nKd 1 1 1\nKs 0 0 0\nd 1\nillum 1\n"
    blocks = [f"newmtl {_material(i)}\n{look}map_Kd {image}\n" for i, image in enumerate(images)]
    if untextured:
        blocks.append(f"newmtl {_material(-1)}\n{look.replace('Kd 1 1 1', 'Kd .5 .5 .5')}")
    return "\n".join(blocks)


def _coordinate_format(vertices: NDArray[np.float64]) -> str:
    diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0))) or 1.0
    return f"%.{max(0, RELATIVE_DIGITS - math.floor(math.log10(diagonal)))}f"


def _per_row(number: str) -> str:
    return " ".join([number] * 3)


def _faces(model: TexturedMesh, page: int) -> str:
    """`f` lines of one page: vertex, texture vertex (if textured), normal (if any), from 1."""
    rows = model.page_of_face == page
    corners = [model.faces[rows]]
    corner = "%d"
    if page >= 0:
        corners.append(model.uv_faces[rows])
        corner += "/%d"
    if model.normals is not None:
        corners.append(model.faces[rows])
        corner += "/%d" if page >= 0 else "//%d"
    numbers = np.stack(corners, axis=-1) + 1
    return _lines(f"f {_per_row(corner)}", numbers.reshape(len(numbers), -1))


def _lines(line: str, rows: NDArray[Any]) -> str:
    """One formatted line per row, by a single call into the formatter."""
    return f"{line}\n" * len(rows) % tuple(rows.ravel().tolist())

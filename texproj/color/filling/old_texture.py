"""The texture that a mesh brings, where no photo sees."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Doubles, Floats, Ints
from texproj.color.filling.gutters import fill_page
from texproj.color.filling.texels import barycentric
from texproj.color.result import Texture
from texproj.layout import Layout
from texproj.mesh import Mesh
from texproj.opencv import opencv_places
from texproj.photo import linear_from_srgb, srgb_from_linear
from texproj.unwrap.texel_faces import face_image

Picture = Callable[[int, int], NDArray[Any] | None]
"""The (h, w, 3) encoded image of a material's number and a tile's, None where there is none."""

ROW_BATCH = 1 << 14
"""Columns that `cv2.remap` takes in one row."""


def with_old_texture(mesh: Mesh, texture: Texture, layout: Layout, picture: Picture) -> Texture:
    """The texture with the mesh's own one in the texels of faces that no photo sees.

    picture: called once for each material and tile that is needed. A material without an image
    gives its plain color; texels of faces without a place in the old texture stay as they are.
    """
    pages = [page.copy() for page in texture.pages]
    for number, page in enumerate(pages):
        faces = face_image(texture.atlas, number)
        empty = (faces >= 0) & (texture.photo_count[number] == 0)
        row, column = np.nonzero(empty)
        face = faces[row, column]
        placed = layout.placed[face]
        row, column, face = row[placed], column[placed], face[placed]
        if len(face):
            xy = np.stack([column + 0.5, row + 0.5], axis=1)
            corners = texture.atlas.uv_px[texture.atlas.faces[face]]
            uv = np.einsum("nk,nkc->nc", barycentric(corners, xy), layout.uv_up[layout.faces[face]])
            for rows, colors in _old_colors(layout, face, uv, picture):
                page[row[rows], column[rows]] = _as(colors, page.dtype)
            fill_page(page, faces >= 0)
    return replace(texture, pages=tuple(pages))


def _old_colors(
    layout: Layout, face: NDArray[np.int32], uv: Doubles, picture: Picture
) -> Iterator[tuple[Ints, Floats]]:
    """Rows and their (n, 3) encoded colors, 0..1, of each material and tile."""
    material = layout.material_of_face[face]
    corner = np.floor(layout.uv_up[layout.faces[face]].min(axis=1) + 1e-6).astype(np.int64)
    keys = np.column_stack([material, corner])
    unique, number = np.unique(keys, axis=0, return_inverse=True)
    for i, (row_of_material, column, line) in enumerate(unique.tolist()):
        rows = np.flatnonzero(number.ravel() == i)
        if row_of_material < 0:
            continue
        factor = np.array(layout.materials[row_of_material].color, np.float32)
        image = picture(row_of_material, 1001 + column + 10 * line)
        if image is not None:
            colors = linear_from_srgb(_sampled(image, uv[rows]))
            yield rows, srgb_from_linear(colors * factor).astype(np.float32)
        elif not layout.materials[row_of_material].why:
            yield rows, np.repeat(srgb_from_linear(factor)[None], len(rows), axis=0)


def _sampled(image: NDArray[Any], uv: Doubles) -> Floats:
    """(n, 3) colors 0..1 at texture coordinates, v up, linearly between texels, repeated."""
    height, width = image.shape[:2]
    xy = np.stack([uv[:, 0] % 1 * width, (1 - uv[:, 1]) % 1 * height], axis=1)
    out = np.empty((len(xy), 3), np.float32)
    scaled = image.astype(np.float32) / np.float32(np.iinfo(image.dtype).max)
    for start in range(0, len(xy), ROW_BATCH):
        at = opencv_places(xy[start : start + ROW_BATCH])[None]
        part = cv2.remap(
            scaled, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP
        )
        out[start : start + ROW_BATCH] = part[0]
    return out


def _as(colors: Floats, kind: np.dtype[Any]) -> NDArray[Any]:
    top = np.iinfo(kind).max
    return np.round(np.clip(colors, 0, 1) * top).astype(kind)

"""A texture baked onto a mesh of fewer faces, with a normal map of what these leave out.

Each texel shows the point of the full mesh that lies along its normal (Cignoni, Montani, Rocchini,
Scopigno, "A general method for preserving attribute values on simplified meshes", 1998).
"""

from __future__ import annotations

from contextlib import closing
from dataclasses import asdict, dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Doubles, Floats
from texproj.color.baking.match import Matcher, Places, mixed
from texproj.color.filling.gutters import fill_page
from texproj.color.filling.texels import barycentric
from texproj.color.points.texels import TexelPoints
from texproj.color.result import Texture
from texproj.mesh import Mesh, NormalMap, face_areas, vertex_normals
from texproj.opencv import opencv_places
from texproj.options import UnwrapOptions
from texproj.resources.scratch import Scratch
from texproj.resources.threads import in_parallel
from texproj.tangent_frames import FLAT, directions_as_colors, tangent_frames
from texproj.unwrap.stretch import flat_areas
from texproj.unwrap.unwrap import unwrap

ROW = 1 << 14
"""Positions in one row: `cv2.remap` takes at most 32767."""


@dataclass(frozen=True, eq=False)
class Baked:
    """The texture of a lighter mesh and its normal map."""

    texture: Texture
    normal_map: NormalMap


def baked(full: Matcher, texture: Texture, light: Mesh, options: UnwrapOptions) -> Baked:
    """The texture of the full mesh on a lighter mesh of the same surface, at the same resolution.

    full: the full mesh; light: in the same frame. Its layout is its own.
    """
    light = replace(light, layout=None)
    atlas = unwrap(light, _density(full, texture, light), replace(options, keep="off"))
    kind = texture.pages[0].dtype
    pages = [np.zeros((h, w, 3), kind) for w, h in atlas.page_sizes]
    counts = [np.zeros((h, w), np.uint8) for w, h in atlas.page_sizes]
    bumps = [np.full((h, w, 3), FLAT, np.uint8) for w, h in atlas.page_sizes]
    tangents = tangent_frames(light, atlas.uv_px, atlas.faces)
    corners = atlas.uv_px[atlas.faces]
    normals = vertex_normals(light)[light.faces].astype(np.float32)
    frames = tangents[atlas.faces].astype(np.float32)
    with closing(Scratch()) as scratch:
        points = TexelPoints.of(light, atlas, scratch)
        shift = (light.center - full.mesh.center).astype(np.float32)

        def one(number: int) -> None:
            tile, chunk = points.tiles[number], points.chunk(number)
            row, column = np.nonzero(points.mask(number))
            xy = np.stack([column + (tile.columns.start + 0.5), row + (tile.rows.start + 0.5)], 1)
            weights = barycentric(corners[chunk.owner], xy).astype(np.float32)
            normal = _unit(mixed(normals[chunk.owner], weights))
            places = full.places(chunk.xyz + shift, normal)
            colors, seen = _read(texture, places)
            points.place(number, pages[tile.page], colors)
            points.place(number, counts[tile.page], seen)
            frame = mixed(frames[chunk.owner], weights)
            bump = directions_as_colors(full.normals_at(places), normal, frame)
            points.place(number, bumps[tile.page], bump)

        in_parallel(one, range(len(points.tiles)))
        for number, (page, bump) in enumerate(zip(pages, bumps, strict=True)):
            known = points.inside(number, page.shape)
            fill_page(page, known)
            fill_page(bump, known)
    quality = {"faces": len(light.faces), "atlas": asdict(atlas.stats)}
    made = Texture(atlas, tuple(pages), tuple(counts), quality, texture.failed)
    return Baked(made, NormalMap(tuple(bumps), tangents))


def _density(full: Matcher, texture: Texture, light: Mesh) -> Doubles:
    """(F,) texels per mesh unit of the light mesh's faces: what the full one's have there."""
    texels = flat_areas(texture.atlas.uv_px, texture.atlas.faces)
    own = np.sqrt(texels / np.maximum(face_areas(full.mesh), 1e-300))
    corners = light.vertices[light.faces]
    middle = (corners.mean(axis=1) - full.mesh.center).astype(np.float32)
    normal = _unit(vertex_normals(light)[light.faces].mean(axis=1).astype(np.float32))
    found = own[full.places(middle, normal).face]
    usual = float(np.median(own))
    return np.clip(found, 0.1 * usual, 10 * usual)


def _read(texture: Texture, places: Places) -> tuple[NDArray[Any], NDArray[np.uint8]]:
    """(n, 3) encoded colors of a texture at places of its mesh, and (n,) photos they are from."""
    atlas = texture.atlas
    xy = mixed(atlas.uv_px[atlas.faces[places.face]], places.weights)
    page_of = atlas.page_of_face[places.face]
    colors = np.zeros((len(xy), 3), texture.pages[0].dtype)
    seen = np.zeros(len(xy), np.uint8)
    for number, page in enumerate(texture.pages):
        rows = np.flatnonzero(page_of == number)
        for start in range(0, len(rows), ROW):
            part = rows[start : start + ROW]
            at = opencv_places(xy[part])[None]
            edge = cv2.BORDER_REPLICATE
            colors[part] = cv2.remap(page, at, None, cv2.INTER_CUBIC, borderMode=edge)[0]
            column, row = np.floor(xy[part]).astype(np.int64).T
            height, width = page.shape[:2]
            seen[part] = texture.photo_count[number][
                row.clip(0, height - 1), column.clip(0, width - 1)
            ]
    return colors, seen


def _unit(vectors: Floats) -> Floats:
    size = np.sqrt(np.einsum("ij,ij->i", vectors, vectors))
    return np.asarray(vectors / np.maximum(size, np.float32(1e-20))[:, None], np.float32)

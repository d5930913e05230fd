"""The surface under a polarized flash on the pages of a texture: what a paint mirrors, between the
vertices.
"""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.appearance.flash.flash_pages import Specular, SurfacePages
from texproj.appearance.flash.reflection import DIELECTRIC
from texproj.appearance.flash.sampled import FlashTexels
from texproj.appearance.recovered import Appearance, PolarizedLight
from texproj.arrays import Floats
from texproj.color.filling.gutters import fill_page
from texproj.color.points.texels import TexelPoints
from texproj.color.result import Texture
from texproj.mesh import Mesh
from texproj.photo import srgb_from_linear
from texproj.resources.scratch import Scratch

TOP = 255


def polarized_pages(
    mesh: Mesh, base: Texture, appearance: Appearance, light: PolarizedLight, occlusion: Floats
) -> SurfacePages:
    """Pages of gloss beside those of the base color, all of 8 bits.

    base: base colors; occlusion: (V,) 1 = open. Roughness, confidence and mirrors are those of the
    vertices, mixed over each face: borders of paints are as sharp as the mesh is fine.
    """
    factor, mirrors = _mirrors(light)
    corner = mirrors[light.label]
    at_vertices = np.column_stack([
        occlusion, appearance.roughness, appearance.metallic, appearance.confidence, corner / factor
    ]).astype(np.float32)  # fmt: skip
    eight = tuple(_eight_bits(page) for page in base.pages)
    orm, sure, specular = ([np.zeros_like(page) for page in eight] for _ in range(3))
    with closing(Scratch()) as scratch:
        points = FlashTexels(TexelPoints.of(mesh, base.atlas, scratch), mesh)
        for number, tile in enumerate(points.texels.tiles):
            chunk = points.chunk(number)
            values = np.einsum(
                "nk,nkc->nc", points.parts(chunk), at_vertices[mesh.faces[chunk.owner]]
            )
            shown = values[:, :3], _gray(values[:, 3]), _gray(srgb_from_linear(values[:, 4]))
            for pages, what in zip((orm, sure, specular), shown, strict=True):
                bytes_ = np.round(what.clip(0, 1) * TOP).astype(np.uint8)
                points.texels.place(number, pages[tile.page], bytes_)
        for pages in (orm, sure, specular):
            for number, page in enumerate(pages):
                fill_page(page, points.texels.inside(number, page.shape))
    return SurfacePages(
        replace(base, pages=eight), tuple(orm), tuple(page[..., 0] for page in sure),
        specular=Specular(tuple(specular), factor) if (corner != 1).any() else None,
    )  # fmt: skip


def _mirrors(light: PolarizedLight) -> tuple[float, Floats]:
    """The largest F0 of the paints over the usual one, and (k,) that of each, 1 where no pair tells
    it.
    """
    own = [kind.material.f0 / DIELECTRIC if kind.f0_known else 1.0 for kind in light.kinds]
    return max(own), np.array(own, np.float32)


def _gray(values: NDArray[Any]) -> NDArray[Any]:
    """(n, 3) of (n,)."""
    return np.repeat(values[:, None], 3, axis=1)


def _eight_bits(page: NDArray[Any]) -> NDArray[np.uint8]:
    if page.dtype == np.uint8:
        return page.copy()
    return np.round(page / np.float32(257)).astype(np.uint8)

"""The surface under the flash on the pages of a texture."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.appearance.flash.everywhere import Points, texels_everywhere
from texproj.appearance.flash.sampled import FlashSamples, FlashTexels
from texproj.appearance.recovered import Appearance, FlashLight
from texproj.arrays import Floats
from texproj.color.filling.gutters import fill_page
from texproj.color.filling.texels import fill_unseen
from texproj.color.points.texels import TexelPoints
from texproj.color.result import Texture
from texproj.color.sampling.photo_set import PhotoSet
from texproj.mesh import Mesh
from texproj.photo import srgb_from_linear
from texproj.render import Renderer
from texproj.resources.scratch import Scratch

TOP = 255


@dataclass(frozen=True, eq=False)
class SurfacePages:
    """base: the texture of base colors; orm: of each page (h, w, 3) uint8 occlusion, roughness and
    metallic; confidence: of each page (h, w) uint8.
    """

    base: Texture
    orm: tuple[NDArray[np.uint8], ...]
    confidence: tuple[NDArray[np.uint8], ...]


@dataclass(frozen=True, eq=False)
class Given:
    """mesh; texture: the blended colors, whose atlas is used; occlusion: (V,) 1 = open."""

    mesh: Mesh
    texture: Texture
    occlusion: Floats


def flash_pages(
    given: Given, photos: PhotoSet, renderer: Renderer, appearance: Appearance,
    progress: Callable[[int], None] = lambda _: None,
) -> SurfacePages:  # fmt: skip
    """The pages, of the materials that were found at the vertices. The same colors as they were,
    matte, where the light was refused.
    """
    texture, light = given.texture, appearance.light
    pages = [_eight_bits(page) for page in texture.pages]
    orm = [np.full(page.shape, (TOP, TOP, 0), np.uint8) for page in pages]
    sure = [np.zeros(page.shape, np.uint8) for page in pages]
    counts = [np.zeros(page.shape[:2], np.uint8) for page in pages]
    with closing(Scratch()) as scratch:
        points = FlashTexels(TexelPoints.of(given.mesh, texture.atlas, scratch), given.mesh)
        if isinstance(light, FlashLight):
            lamp, read = light.found.lamp, (given.mesh, points, photos, renderer)
            samples = FlashSamples.of(*read, lamp, scratch, progress)
        for number, tile in enumerate(points.texels.tiles):
            if isinstance(light, FlashLight):
                found = _texels(points, samples, light, number)
                _place(points, number, pages, srgb_from_linear(found.color))
                _place(points, number, sure, np.repeat(found.sure[:, None], 3, axis=1))
                values = np.minimum(found.number, TOP).astype(np.uint8)
                points.texels.place(number, counts[tile.page], values)
            _place(points, number, orm, _gloss(given, points, appearance, number))
        if isinstance(light, FlashLight):
            for some in (pages, sure):
                fill_unseen(given.mesh, texture.atlas, points.texels, some, counts)
        for some in (pages, orm, sure):
            for number, page in enumerate(some):
                fill_page(page, points.texels.inside(number, page.shape))
    base = replace(texture, pages=tuple(pages), photo_count=tuple(counts))
    return SurfacePages(base, tuple(orm), tuple(page[..., 0] for page in sure))


def _texels(points: FlashTexels, samples: FlashSamples, light: FlashLight, number: int) -> Points:
    corner = points.mesh.faces[points.chunk(number).owner]
    allowed = np.zeros((len(corner), len(light.found.kinds)), bool)
    for k in range(3):
        allowed[np.arange(len(corner)), light.label[corner[:, k]]] = True
    return texels_everywhere(samples, light.found, number, allowed)


def _gloss(given: Given, points: FlashTexels, appearance: Appearance, number: int) -> Floats:
    """(n, 3) occlusion, roughness and metallic of texels, between those of the corners."""
    chunk = points.chunk(number)
    part, corner = points.parts(chunk), given.mesh.faces[chunk.owner]
    values = np.stack([given.occlusion, appearance.roughness, appearance.metallic], axis=1)
    mixed: Floats = np.einsum("nk,nkc->nc", part, values[corner])
    return mixed


def _place(points: FlashTexels, number: int, pages: list[Any], values: Floats) -> None:
    page = pages[points.texels.tiles[number].page]
    points.texels.place(number, page, np.round(values.clip(0, 1) * TOP).astype(np.uint8))


def _eight_bits(page: NDArray[Any]) -> NDArray[np.uint8]:
    if page.dtype == np.uint8:
        return page.copy()
    return np.round(page / np.float32(257)).astype(np.uint8)

"""The surface under the flash on the pages of a texture."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.appearance.flash.everywhere import Points, texels_everywhere
from texproj.appearance.flash.few_views import ENOUGH
from texproj.appearance.flash.found import Found
from texproj.appearance.flash.normals_verdict import NormalsVerdict, judged_normals
from texproj.appearance.flash.reflection import DIELECTRIC
from texproj.appearance.flash.sampled import FlashSamples, FlashTexels
from texproj.appearance.recovered import Appearance, FlashLight
from texproj.arrays import Bools, Doubles, Floats
from texproj.color.filling.gutters import fill_page
from texproj.color.filling.texels import fill_unseen
from texproj.color.points.texels import TexelPoints
from texproj.color.result import Texture
from texproj.color.sampling.photo_set import PhotoSet
from texproj.mesh import Mesh, NormalMap
from texproj.photo import srgb_from_linear
from texproj.render import Renderer
from texproj.resources.scratch import Scratch
from texproj.tangent_frames import FLAT, directions_as_colors, tangent_frames
from texproj.unwrap.atlas import Atlas

TOP = 255


@dataclass(frozen=True, eq=False)
class Specular:
    """pages: (h, w, 3) uint8 sRGB each; they times `factor`, linear, are F0 over that of an index
    of 1.5, as KHR_materials_specular has it.
    """

    pages: tuple[NDArray[np.uint8], ...]
    factor: float


@dataclass(frozen=True, eq=False)
class SurfacePages:
    """base: the texture of base colors; orm: of each page (h, w, 3) uint8 occlusion, roughness and
    metallic; confidence: of each page (h, w) uint8; normal_map: finer than the mesh, None where the
    photos tell none; normals: by what that was judged, None where the light was refused; specular:
    what paints mirror, None where no photo tells it.
    """

    base: Texture
    orm: tuple[NDArray[np.uint8], ...]
    confidence: tuple[NDArray[np.uint8], ...]
    normal_map: NormalMap | None = None
    normals: NormalsVerdict | None = None
    specular: Specular | None = None


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
    light = appearance.light
    with closing(Scratch()) as scratch:
        points = FlashTexels(TexelPoints.of(given.mesh, given.texture.atlas, scratch), given.mesh)
        made = _Made(given, appearance, points)
        if not isinstance(light, FlashLight):
            return made.matte()
        lamp, read = light.found.lamp, (given.mesh, points, photos, renderer)
        samples = FlashSamples.of(*read, lamp, scratch, progress)
        return made.lit(samples, light)


class _Made:
    """Pages as they are made, tile by tile."""

    def __init__(self, given: Given, appearance: Appearance, points: FlashTexels) -> None:
        self._given, self._appearance, self._points = given, appearance, points
        pages = given.texture.pages
        self._base = [_eight_bits(page) for page in pages]
        self._orm = [np.full(page.shape, (TOP, TOP, 0), np.uint8) for page in pages]
        self._sure = [np.zeros(page.shape, np.uint8) for page in pages]
        self._counts = [np.zeros(page.shape[:2], np.uint8) for page in pages]

    def matte(self) -> SurfacePages:
        """Without a light."""
        for number in range(len(self._points.texels.tiles)):
            self._place(number, self._orm, self._between(number, self._corners))
        self._without_gaps(self._base, self._orm, self._sure)
        return SurfacePages(self._texture(), tuple(self._orm), self._confidence())

    def lit(self, samples: FlashSamples, light: FlashLight) -> SurfacePages:
        """As the photos say. samples: of the texels."""
        found = light.found
        verdict = judged_normals(samples, found, lambda number: self._allowed(light, number))
        factor, mirrored = _mirrors(found)
        specular = [np.zeros_like(page) for page in self._base]
        bumps = [np.full_like(page, FLAT) for page in self._base]
        frames = tangent_frames(self._given.mesh, self._atlas.uv_px, self._atlas.faces)
        for number, tile in enumerate(self._points.texels.tiles):
            told = texels_everywhere(
                samples, found, number, self._allowed(light, number), verdict.accepted
            )
            self._place(number, self._base, srgb_from_linear(self._colors(number, told)))
            self._place(number, self._sure, np.repeat(told.sure[:, None], 3, axis=1))
            counts = np.minimum(told.number, TOP).astype(np.uint8)
            self._points.texels.place(number, self._counts[tile.page], counts)
            self._place(number, self._orm, self._gloss(number, told, found))
            shown = srgb_from_linear(mirrored[told.label] / factor)
            self._place(number, specular, np.repeat(shown[:, None], 3, axis=1))
            if verdict.accepted:
                bump = self._bump(number, told, frames[self._atlas.faces])
                self._points.texels.place(number, bumps[tile.page], bump)
        for some in (self._base, self._sure):
            fill_unseen(self._given.mesh, self._atlas, self._points.texels, some, self._counts)
        self._without_gaps(self._base, self._orm, self._sure, specular, bumps)
        return SurfacePages(
            self._texture(), tuple(self._orm), self._confidence(),
            NormalMap(tuple(bumps), frames) if verdict.accepted else None, verdict,
            Specular(tuple(specular), factor) if (mirrored != 1).any() else None,
        )  # fmt: skip

    @property
    def _atlas(self) -> Atlas:
        return self._given.texture.atlas

    def _texture(self) -> Texture:
        counts = tuple(self._counts)
        return replace(self._given.texture, pages=tuple(self._base), photo_count=counts)

    def _confidence(self) -> tuple[NDArray[np.uint8], ...]:
        return tuple(page[..., 0] for page in self._sure)

    def _allowed(self, light: FlashLight, number: int) -> Bools:
        """(n, k) the materials of the corners of the texels' faces."""
        corner = self._given.mesh.faces[self._points.chunk(number).owner]
        allowed = np.zeros((len(corner), len(light.found.kinds)), bool)
        for k in range(3):
            allowed[np.arange(len(corner)), light.label[corner[:, k]]] = True
        return allowed

    @property
    def _corners(self) -> Floats:
        """(V, 3) occlusion, roughness and metallic."""
        own = self._appearance
        return np.stack([self._given.occlusion, own.roughness, own.metallic], axis=1)

    def _between(self, number: int, corners: Floats) -> Floats:
        """(n, c) what texels have between the vertices of their faces, (V, c)."""
        chunk = self._points.chunk(number)
        part, corner = self._points.parts(chunk), self._given.mesh.faces[chunk.owner]
        mixed: Floats = np.einsum("nk,nkc->nc", part, corners[corner])
        return mixed

    def _colors(self, number: int, told: Points) -> Floats:
        """(n, 3) base colors: where few photos see a texel, those of the vertices, which have
        neighbors to ask.
        """
        few = (told.number < ENOUGH)[:, None]
        return np.where(few, self._between(number, self._appearance.base), told.color)

    def _gloss(self, number: int, told: Points, found: Found) -> Floats:
        """The same, of the texel's own material where enough photos see it: borders are sharp."""
        out = self._between(number, self._corners)
        known = told.number >= ENOUGH
        kinds = np.array([(x.roughness, x.material.metal) for x in found.materials], np.float32)
        out[known, 1:] = kinds[told.label[known]]
        return out

    def _bump(self, number: int, told: Points, corners: Doubles) -> NDArray[np.uint8]:
        """(n, 3) normals as colors. corners: (F, 3, 4) tangents of the faces' corners."""
        chunk = self._points.chunk(number)
        own = self._points.surfel(number).normal
        part = self._points.parts(chunk)
        frame = np.einsum("nk,nkc->nc", part, corners[chunk.owner].astype(np.float32))
        return directions_as_colors(told.normal, own, frame)

    def _place(self, number: int, pages: list[Any], values: Floats) -> None:
        page = pages[self._points.texels.tiles[number].page]
        shown = np.round(values.clip(0, 1) * TOP).astype(np.uint8)
        self._points.texels.place(number, page, shown)

    def _without_gaps(self, *kinds: list[Any]) -> None:
        for pages in kinds:
            for number, page in enumerate(pages):
                fill_page(page, self._points.texels.inside(number, page.shape))


def _mirrors(found: Found) -> tuple[float, Floats]:
    """The largest F0 of the materials over the usual one, and (k,) that of each, 1 where no photo
    tells it.
    """
    own = [
        one.material.f0 / DIELECTRIC if one.f0_known and not one.material.metal else 1.0
        for one in found.materials
    ]
    return max(own), np.array(own, np.float32)


def _eight_bits(page: NDArray[Any]) -> NDArray[np.uint8]:
    if page.dtype == np.uint8:
        return page.copy()
    return np.round(page / np.float32(257)).astype(np.uint8)

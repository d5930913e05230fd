"""The light taken out of a texture: soft light from the vertices, the sun texel by texel."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.appearance.corners import barycentric
from texproj.appearance.light_fit import GLOSS, LEAST_LIGHT
from texproj.appearance.natural import base_color
from texproj.appearance.recovered import Appearance, NaturalLight
from texproj.appearance.transfer import LightCaster
from texproj.arrays import Doubles, Floats
from texproj.color.filling.gutters import fill_page
from texproj.color.filling.texels import fill_unseen
from texproj.color.points.source import Chunk
from texproj.color.points.texels import TexelPoints
from texproj.color.result import Texture
from texproj.mesh import Mesh
from texproj.photo import linear_from_srgb, srgb_from_linear
from texproj.resources.scratch import Scratch

TEXEL_SUN_RAYS = 4


def base_texture(mesh: Mesh, texture: Texture, appearance: Appearance) -> Texture:
    """The texture's pages as base color, of the same depth; the same pages where the light was
    refused. The appearance is that of the mesh's vertices, found in the same photos.
    """
    light, irradiance = appearance.light, appearance.irradiance
    if light is None or irradiance is None:
        return texture
    gloss = GLOSS if appearance.mirrored is None else 0.0
    lamp = _Lamp(mesh, light, irradiance)
    pages: list[NDArray[Any]] = [page.copy() for page in texture.pages]
    with closing(Scratch()) as scratch:
        points = TexelPoints.of(mesh, texture.atlas, scratch)
        for number, tile in enumerate(points.tiles):
            page = pages[tile.page]
            top = np.iinfo(page.dtype).max
            shown = page[tile.rows, tile.columns][points.mask(number)]
            rgb = linear_from_srgb(shown / np.float32(top))
            base = base_color(rgb / lamp.at(points.chunk(number)), gloss)
            points.place(number, page, np.round(srgb_from_linear(base) * top).astype(page.dtype))
        fill_unseen(mesh, texture.atlas, points, pages, list(texture.photo_count))
        for number, page in enumerate(pages):
            fill_page(page, points.inside(number, page.shape))
    return replace(texture, pages=tuple(pages))


class _Lamp:
    """The irradiance, over pi, of any point of the surface."""

    def __init__(self, mesh: Mesh, light: object, irradiance: Floats) -> None:
        self._caster = LightCaster(mesh, irradiance)
        self._faces, self._corners = mesh.faces, self._caster.xyz
        self._to_sun: Doubles | None = None
        self._sun = np.zeros(3, np.float32)
        soft = irradiance
        if isinstance(light, NaturalLight) and light.to_sun is not None and light.sun is not None:
            self._to_sun = light.to_sun
            self._sun = (light.sun / np.pi).astype(np.float32)
            everyone = np.arange(len(irradiance))
            soft = soft - self._caster.sun_on(everyone, light.to_sun)[:, None] * self._sun
        self._soft = np.maximum(soft, LEAST_LIGHT * irradiance.mean(axis=0))

    def at(self, chunk: Chunk) -> Floats:
        """(n, 3) at points on faces, relative to the mesh's center."""
        corner = self._faces[chunk.owner]
        part = barycentric(self._corners[corner], chunk.xyz)
        light: Floats = np.einsum("nk,nkc->nc", part, self._soft[corner])
        if self._to_sun is None:
            return light
        normal = np.einsum("nk,nkc->nc", part, self._caster.normals[corner])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        cosine = self._caster.sun_at(chunk.xyz, normal, self._to_sun, TEXEL_SUN_RAYS)
        return light + cosine[:, None] * self._sun

"""Pictures of colored models as photographed, without light of our own."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Bytes, Floats
from texproj.camera import Camera
from texproj.mesh import ColoredMesh, Mesh, TexturedMesh, face_cross
from texproj.photo import linear_from_srgb, srgb_from_linear
from texproj.render.interface import Renderer
from texproj.render.lens import ideal_grid
from texproj.render.surface import Hits, Surface, hits_on_faces, values_at_hits

NO_TEXTURE = 0.2
"""Linear grey of faces without texture."""

WHITE = np.float32(65535)
"""Linear 1 in mipmaps."""


def render_model(
    renderer: Renderer, model: TexturedMesh | ColoredMesh, camera: Camera, samples: int = 2
) -> Bytes:
    """(h, w, 4) uint8 sRGB and alpha: the model as `camera` sees it, unlit, both sides.

    Colors are interpolated in linear light, textures through mipmaps whose level follows from the
    texels that a pixel covers on its face. samples: rays per pixel along each axis, averaged in
    linear light; alpha is the part of them that meets the model.
    """
    return next(model_pictures(renderer, model, [camera], samples))


def model_pictures(
    renderer: Renderer,
    model: TexturedMesh | ColoredMesh,
    cameras: Iterable[Camera],
    samples: int = 2,
) -> Iterator[Bytes]:
    """The same from several cameras, one after the other; the mesh is loaded once."""
    surface = Surface(Mesh(model.vertices, model.faces))
    with renderer.load(surface.mesh) as scene:
        for camera in cameras:
            fine = camera.resized(camera.width * samples, camera.height * samples)
            face = scene.gbuffer(fine, ("face",)).require("face")
            ideal = ideal_grid(fine.intrinsics).reshape(-1, 2)
            hits = hits_on_faces(surface, fine, ideal, face.ravel())
            if isinstance(model, TexturedMesh):
                color = _texture_at(model, surface, fine, hits)
            else:
                color = values_at_hits(surface, hits, _linear(model.colors[:, :3]))
            seen = (hits.face >= 0).astype(np.float32)
            layers = np.concatenate([color * seen[:, None], seen[:, None]], axis=1)
            layers = layers.reshape(fine.height, fine.width, 4)
            size = (camera.width, camera.height)
            yield _encoded(cv2.resize(layers, size, interpolation=cv2.INTER_AREA))


def _linear(encoded: NDArray[Any]) -> Floats:
    """Linear light, 0..1, of sRGB-encoded uint8 or uint16, through a table."""
    top = np.iinfo(encoded.dtype).max
    table = linear_from_srgb(np.arange(top + 1) / top).astype(np.float32)
    return table[encoded]


def _encoded(layers: Floats) -> Bytes:
    """(h, w, 4) uint8 of linear color, multiplied by alpha, and alpha."""
    alpha = layers[..., 3:]
    color = np.divide(layers[..., :3], alpha, out=np.zeros_like(layers[..., :3]), where=alpha > 0)
    image = np.concatenate([srgb_from_linear(color.clip(0, 1)), alpha], axis=-1)
    return np.round(255 * image).astype(np.uint8)


@dataclass(frozen=True, eq=False)
class Footprint:
    """Where pixels lie on the texture: x, y (n,) from its top left corner as parts of its size, and
    area (n,) the part of the page that one pixel covers.
    """

    x: Floats
    y: Floats
    area: Floats


def _texture_at(model: TexturedMesh, surface: Surface, camera: Camera, hits: Hits) -> Floats:
    """(n, 3) linear color of the texture where the hits are; one page in memory at a time."""
    color = np.full((len(hits.face), 3), NO_TEXTURE, np.float32)
    seen = np.flatnonzero(hits.face >= 0)
    footprint = _footprint(model, surface, camera, hits, seen)
    page_of_hit = model.page_of_face[hits.face[seen]]
    for number, page in enumerate(model.pages):
        here = np.flatnonzero(page_of_hit == number)
        if len(here):
            part = Footprint(footprint.x[here], footprint.y[here], footprint.area[here])
            color[seen[here]] = _sampled(page[..., :3], part)
    return color


def _footprint(
    model: TexturedMesh, surface: Surface, camera: Camera, hits: Hits, seen: NDArray[np.intp]
) -> Footprint:
    face, u, v = hits.face[seen], hits.u[seen, None], hits.v[seen, None]
    a, b, c = (model.uv[model.uv_faces[face, i]].astype(np.float32) for i in range(3))
    at = (1 - u - v) * a + u * b + v * c
    (p, q), (r, s) = (b - a).T, (c - a).T
    cross = face_cross(surface.xyz_in_local, surface.mesh.faces)[face]
    to_hit = surface.rays(camera, ideal_grid(camera.intrinsics).reshape(-1, 2)[seen])
    # a pixel covers depth^2 / (fx fy) across the axis, and 1 / cosine more along the surface:
    # |n . ray| with ray_z = 1 is the cosine in that frame
    facing = np.abs(np.einsum("ij,ij->i", cross, to_hit))
    size = hits.depth[seen] ** 2 / (camera.intrinsics.fx * camera.intrinsics.fy)
    per_area = np.abs(p * s - q * r) / np.maximum(facing, 1e-30)
    return Footprint(at[:, 0], 1 - at[:, 1], (per_area * size).astype(np.float32))


def _sampled(page: NDArray[Any], at: Footprint) -> Floats:
    """(n, 3) linear color of a page, trilinear between its mipmap levels."""
    texels = np.maximum(at.area * page.shape[0] * page.shape[1], 1.0)
    level = np.log2(texels) / 2
    color = np.zeros((len(level), 3), np.float32)
    for number, image, last in _mipmaps(page):
        weight = 1 - np.abs(level - number)
        if last:
            weight = np.where(level > number, 1, weight)
        here = np.flatnonzero(weight > 0)
        if len(here):
            color[here] += weight[here, None] * _bilinear(image, at.x[here], at.y[here])
    return color


def _mipmaps(page: NDArray[Any]) -> Iterator[tuple[int, NDArray[np.uint16], bool]]:
    """(number, (h, w, 3) image, whether it is the last) of each level, halved each time.

    Images are uint16 in linear light, which keeps 20 steps in the darkest one of 8-bit sRGB.
    """
    table = np.round(_linear(np.arange(np.iinfo(page.dtype).max + 1, dtype=page.dtype)) * WHITE)
    coded = np.ascontiguousarray(page)
    small = table.astype(np.uint16)
    image, number = cv2.LUT(coded, small) if coded.itemsize == 1 else small[coded], 0
    while True:
        last = min(image.shape[:2]) < 2
        yield number, image, last
        if last:
            return
        half = (image.shape[1] // 2, image.shape[0] // 2)
        image, number = cv2.resize(image, half, interpolation=cv2.INTER_AREA), number + 1


def _bilinear(image: NDArray[np.uint16], x: Floats, y: Floats) -> Floats:
    """(n, 3) values, 0..1, at x, y (n,), parts of the image's width and height; clamped at the
    border.
    """
    height, width = image.shape[:2]
    column = np.clip(x * width - 0.5, 0, width - 1)
    row = np.clip(y * height - 0.5, 0, height - 1)
    left, top = np.floor(column).astype(np.intp), np.floor(row).astype(np.intp)
    right, below = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
    fx, fy = (column - left)[:, None] / WHITE, (row - top)[:, None]
    upper = (1 / WHITE - fx) * image[top, left] + fx * image[top, right]
    lower = (1 / WHITE - fx) * image[below, left] + fx * image[below, right]
    return ((1 - fy) * upper + fy * lower).astype(np.float32)

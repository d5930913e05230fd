"""Pictures of colored models as photographed, without light of our own."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Bytes, Floats
from texproj.camera import Camera
from texproj.mesh import ColoredMesh, Mesh, TexturedMesh
from texproj.photo import srgb_from_linear
from texproj.render.interface import Renderer, Scene
from texproj.render.lens import ideal_grid
from texproj.render.mipmaps import Footprint, Mipmaps, linear_table
from texproj.resources.threads import in_parallel

NO_TEXTURE = 0.2
"""Linear grey of faces without texture."""

STRIP = 1 << 17
"""Rays that are shaded at once: fits a processor's cache, and bounds the memory to 50 MB."""

Paint = Callable[["Met"], Floats]
"""(n, 3) linear colors of the model where rays meet it."""


@dataclass(frozen=True)
class ModelLook:
    """How a model is shown. samples: rays per pixel along each axis, averaged in linear light;
    backs: linear grey of the inner sides of faces, None = their color, as in usual viewers.
    """

    samples: int = 2
    backs: float | None = None


@dataclass(frozen=True, eq=False)
class Met:
    """Where rays meet faces. face: (n,) int32; weights: (n, 3) of its corners; covered: (n,) area
    of a pixel on the face as part of the face's; outside: (n,) bool, seen from its outer side.
    """

    face: NDArray[np.int32]
    weights: Floats
    covered: Floats
    outside: NDArray[np.bool_]


def render_model(
    renderer: Renderer, model: TexturedMesh | ColoredMesh, camera: Camera, samples: int = 2
) -> Bytes:
    """(h, w, 4) uint8 sRGB and alpha: the model as `camera` sees it, unlit, both sides.

    Colors are interpolated in linear light, textures through mipmaps whose level follows from the
    texels that a pixel covers on its face. samples: rays per pixel along each axis, averaged in
    linear light; alpha is the part of them that meets the model.
    """
    return next(model_pictures(renderer, model, [camera], ModelLook(samples)))


def model_pictures(
    renderer: Renderer,
    model: TexturedMesh | ColoredMesh,
    cameras: Iterable[Camera],
    look: ModelLook | None = None,
) -> Iterator[Bytes]:
    """The same from several cameras, one after the other; mesh and texture are loaded once."""
    paint = paint_of(model)
    with renderer.load(Mesh(model.vertices, model.faces)) as scene:
        for camera in cameras:
            yield _picture(scene, paint, camera, look or ModelLook())


def _picture(scene: Scene, paint: Paint, camera: Camera, look: ModelLook) -> Bytes:
    def shade(met: Met) -> Floats:
        color = paint(met)
        if look.backs is not None:
            color[~met.outside] = look.backs
        return color

    out = np.zeros((camera.height, camera.width, 4), np.uint8)

    def keep(rows: slice, layers: Floats) -> None:
        out[rows] = _encoded(layers)

    draw(scene, shade, camera, look.samples, keep)
    return out


def draw(
    scene: Scene,
    shade: Paint,
    camera: Camera,
    samples: int,
    keep: Callable[[slice, Floats], None],
) -> None:
    """Draw a picture strip by strip, in threads. shade: the color of what rays meet; keep: takes
    rows of the picture, (h, w, 4) linear colors times alpha, and alpha.
    """
    fine = camera.resized(camera.width * samples, camera.height * samples)
    face, ideal = scene.gbuffer(fine, ("face",)).require("face"), ideal_grid(fine.intrinsics)
    surface = scene.surface
    matrix = surface.cam_from_local(fine).astype(np.float32)
    xyz_in_cam = surface.xyz_in_local @ matrix[:, :3].T + matrix[:, 3]
    pixel = 1 / (fine.intrinsics.fx * fine.intrinsics.fy)
    step = max(1, STRIP // (fine.width * samples))

    def one(number: int) -> None:
        rows = slice(number * step, min((number + 1) * step, camera.height))
        part = slice(rows.start * samples, rows.stop * samples)
        seen = face[part] >= 0
        if not seen.any():
            return
        met = meet(xyz_in_cam[surface.mesh.faces[face[part][seen]]], ideal[part][seen], pixel)
        met = Met(face[part][seen], met.weights, met.covered, met.outside)
        layers = np.zeros((*seen.shape, 4), np.float32)
        layers[seen, :3], layers[seen, 3] = shade(met), 1
        size = (camera.width, rows.stop - rows.start)
        keep(rows, cv2.resize(layers, size, interpolation=cv2.INTER_AREA))

    in_parallel(one, range(-(-camera.height // step)))


def meet(corners: Floats, ideal: Floats, pixel: float) -> Met:
    """Where rays through `ideal` (n, 2) normalized coordinates meet the faces drawn there, whose
    `corners` (n, 3, 3) are in camera axes; face is left empty. pixel: area of one in `ideal`.

    A ray that rounding led just past its face meets the nearest end of it in barycentric
    coordinates. Moeller and Trumbore 1997.
    """
    a, b, c = (np.ascontiguousarray(corners[:, k]) for k in range(3))
    along, across = b - a, c - a
    ray = np.column_stack([ideal, np.ones(len(ideal), np.float32)])
    normal = _cross(along, across)
    facing = np.einsum("ij,ij->i", normal, ray)  # |normal| times cosine, of a ray with z = 1
    moment = _cross(ray, a)
    det = np.where(facing == 0, np.float32(np.inf), facing)
    u = -np.einsum("ij,ij->i", moment, across) / det
    v = np.einsum("ij,ij->i", moment, along) / det
    weights = np.maximum(np.stack([1 - u - v, u, v], axis=1), 0)
    weights /= weights.sum(axis=1, keepdims=True)
    depth = np.einsum("ij,ij->i", weights, corners[:, :, 2])
    # a pixel covers depth^2 pixel across the axis, and 1 / cosine more along the surface
    covered = 2 * pixel * depth**2 / np.maximum(np.abs(facing), np.float32(1e-30))
    outside = np.einsum("ij,ij->i", normal, a) < 0
    return Met(np.zeros(0, np.int32), weights, covered, outside)


def _cross(a: Floats, b: Floats) -> Floats:
    """(n, 3) cross products; several times faster than numpy's."""
    x, y, z = a.T
    p, q, r = b.T
    return np.stack([y * r - z * q, z * p - x * r, x * q - y * p], axis=1)


def _encoded(layers: Floats) -> Bytes:
    """(h, w, 4) uint8 of linear color, multiplied by alpha, and alpha."""
    alpha = layers[..., 3:]
    color = np.divide(layers[..., :3], alpha, out=np.zeros_like(layers[..., :3]), where=alpha > 0)
    image = np.concatenate([srgb_from_linear(color.clip(0, 1)), alpha], axis=-1)
    return np.round(255 * image).astype(np.uint8)


def paint_of(model: TexturedMesh | ColoredMesh) -> Paint:
    """The colors of a model."""
    return _textured(model) if isinstance(model, TexturedMesh) else _colored(model)


def _colored(model: ColoredMesh) -> Paint:
    linear = linear_table(model.colors.dtype)[model.colors[:, :3]]

    def paint(met: Met) -> Floats:
        corners = linear[model.faces[met.face]]
        mixed: Floats = np.einsum("nk,nkc->nc", met.weights, corners)
        return mixed

    return paint


def _textured(model: TexturedMesh) -> Paint:
    return _read(model, [Mipmaps(page) for page in model.pages], (NO_TEXTURE,) * 3)


def bumps_of(model: TexturedMesh | ColoredMesh) -> Paint | None:
    """The colors of a model's normal map, 0..1, half and half and 1 where it has no texture; None
    where there is none.
    """
    if not isinstance(model, TexturedMesh) or model.normal_map is None:
        return None
    pages = [Mipmaps(page, colors=False) for page in model.normal_map.pages]
    return _read(model, pages, (0.5, 0.5, 1.0))


def _read(model: TexturedMesh, pages: list[Mipmaps], elsewhere: tuple[float, ...]) -> Paint:
    uv = (model.uv * (1, -1) + (0, 1)).astype(np.float32)
    (p, q), (r, s) = ((uv[model.uv_faces[:, k]] - uv[model.uv_faces[:, 0]]).T for k in (1, 2))
    area_of_face = np.abs(p * s - q * r) / 2

    def paint(met: Met) -> Floats:
        x, y = np.einsum("nk,nkc->cn", met.weights, uv[model.uv_faces[met.face]])
        place = Footprint(x, y, met.covered * area_of_face[met.face])
        color = np.tile(np.array(elsewhere, np.float32), (len(x), 1))
        page_of_ray = model.page_of_face[met.face]
        for number, page in enumerate(pages):
            here = np.flatnonzero(page_of_ray == number)
            if len(here):
                color[here] = page.at(place.chosen(here))
        return color

    return paint

"""How far the colors of a model are from the truth of a synthetic scene, in CIEDE2000.

Two measures. On the surface: at random points of the scan the model's color against the light that
the true surface there sends out, averaged over the footprint of a pixel. In pictures: the model
rendered into cameras against what an ideal photographer sees there (normal exposure, no vignetting,
nobody in front, in focus, no highlight, no noise, 25 rays per pixel).

Counted is what at least one photo sees. Pictures leave out what is within two pixels of the piece's
outline: a pixel there shows other things too. Points leave out what lies further than 2 mm (five
times the scan's noise) from the true surface: coarse scans cut corners there, and what the color of
such a point should be is not defined. Edges inside of the outline, creases and shadow borders
count. The brightness of the whole is not in the photos (it is a gauge), so that one common factor,
the median, is taken out and told beside.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import cv2
import numpy as np
from scenes import NO_DEFECTS, Defects, Synthetic, exposure_round, round_scene, scan_of
from skimage.color import deltaE_ciede2000, rgb2lab

from texproj.camera import Camera
from texproj.demo import lens
from texproj.demo.caster import Caster
from texproj.demo.light import unit
from texproj.demo.make import colors_on
from texproj.demo.photographer import Scene, ShotOptions, photograph
from texproj.demo.sensor import Sensor
from texproj.demo.views import View, camera_at
from texproj.mesh import ColoredMesh, Mesh, TexturedMesh, face_areas, vertex_normals
from texproj.photo import linear_from_srgb, srgb_from_linear
from texproj.render import Renderer, render_model

NEW = tuple(View(a, e, upright=False) for a, e in ((-32, 18), (-2, 26), (24, 16)))
"""Where no photo of the set was taken."""

COARSE, TRUE = 40_000, 0
"""Faces of the scan beside `exposure_round`; and of none: the true surface in its place."""

MARGIN_PX = 2
"""Pixels at the outline of the piece that are not counted."""

OFF_SURFACE = 0.002
"""Metres from the true surface beyond which a point of the scan does not count."""

LEAST_COSINE = 0.1
"""Surface turned further away from a camera is not seen by it."""

FOOTPRINT = 0.45 * 0.0028
"""Metres: deviation of the Gaussian over which true colors on the surface are averaged. A pixel of
the photos is 2.8 mm wide on the piece; its square has a deviation of .29 of that, and bilinear
sampling adds about as much."""


@dataclass(frozen=True, eq=False)
class TruePoints:
    """Points of the scan. face: (n,), at: (n, 3) barycentric weights; light: (n, 3) linear;
    seen_by: (n,) number of photos that show the point, -1 where it does not count.
    """

    face: np.ndarray
    at: np.ndarray
    light: np.ndarray
    seen_by: np.ndarray


@dataclass(frozen=True, eq=False)
class TrueView:
    """An ideal photo. light: (h, w, 3) linear; seen_by: (h, w) number of photos that show what the
    pixel shows, -1 where the pixel does not count.
    """

    camera: Camera
    light: np.ndarray
    seen_by: np.ndarray


@dataclass(frozen=True)
class Errors:
    """CIEDE2000: median and 95 % of all that counts; gain: factor by which the model was too dark;
    share: counted part.
    """

    median: float
    p95: float
    gain: float
    share: float


@lru_cache(maxsize=4)
def true_points(faces: int, count: int = 30_000) -> TruePoints:
    """Random points, evenly over the scan of so many faces."""
    data, scene = made(Defects(), faces)
    rng = np.random.default_rng(5)
    mesh, area = data.mesh, face_areas(data.mesh)
    face = rng.choice(len(area), count, p=area / area.sum())
    at = rng.dirichlet((1, 1, 1), count)
    corners = mesh.faces[face]
    normals = unit(np.einsum("nk,nkc->nc", at, vertex_normals(mesh)[corners])).astype(np.float32)
    xyz = np.einsum("nk,nkc->nc", at, mesh.vertices[corners]).astype(np.float32)
    seen = seen_by(Caster(mesh, np.zeros(3)), xyz, normals, data)
    seen[~_near(scene.caster, xyz, normals)] = -1
    return TruePoints(face, at, colors_on(scene, xyz, normals, FOOTPRINT)[1], seen)


def _near(caster: Caster, xyz: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(n,) bool: whether the true surface is near the points, along their normals."""
    out = caster.first_hits(xyz + np.float32(OFF_SURFACE) * normals, -normals)
    near = np.zeros(len(xyz), bool)
    near[out.found] = out.distance < 2 * OFF_SURFACE
    return near


@lru_cache(maxsize=4)
def true_views(unused: bool, samples: int = 5, count: int = 4) -> tuple[TrueView, ...]:
    """Ideal photos with the cameras of every second photo, or from places where none was taken.

    samples: rays per pixel along a side; count: most pictures.
    """
    data, scene = made(Defects())
    cameras = data.cameras[::2]
    if unused:
        size = data.photos[0].width
        cameras = tuple(
            camera_at(view, data.mesh.bounds, size, np.random.default_rng([i, 77]))
            for i, view in enumerate(NEW)
        )
    return tuple(_true_view(data, scene, camera, samples) for camera in cameras[:count])


def _true_view(data: Synthetic, scene: Scene, camera: Camera, samples: int) -> TrueView:
    how = ShotOptions(samples, "wall", Sensor(full_well=0), vignetting=0)
    shot = photograph(scene, camera, how)
    inside = cv2.erode(shot.object_mask, np.ones((2 * MARGIN_PX + 1,) * 2, np.uint8)) > 0
    rays = lens.directions(camera.intrinsics)[inside] @ camera.pose.R.astype(np.float32)
    center = np.broadcast_to(camera.center.astype(np.float32), rays.shape)
    hits = scene.caster.first_hits(center, rays)
    normals = unit(scene.caster.at(hits, scene.surface)[:, :3])
    xyz = center[hits.found] + rays[hits.found] * hits.distance[:, None]
    seen = np.full(len(rays), -1)
    seen[hits.found] = seen_by(scene.caster, xyz, normals, data)
    image = np.full(inside.shape, -1)
    image[inside] = seen
    return TrueView(camera, shot.light, image)


def seen_by(caster: Caster, xyz: np.ndarray, normals: np.ndarray, data: Synthetic) -> np.ndarray:
    """(n,) in how many photos (n, 3) points are seen, by rays."""
    count = np.zeros(len(xyz), int)
    for camera, mask in zip(data.cameras, data.masks, strict=True):
        to_eye = unit(camera.center.astype(np.float32) - xyz)
        facing = np.einsum("ij,ij->i", normals, to_eye) > LEAST_COSINE
        xy, _ = camera.project(xyz.astype(np.float64))
        column, row = np.nan_to_num(np.floor(xy), nan=-1).astype(int).T
        inside = (column >= 0) & (row >= 0) & (column < camera.width) & (row < camera.height)
        inside[inside] = mask[row[inside], column[inside]] > 0
        open_ = ~caster.blocked(xyz + 1e-3 * normals + 1e-3 * to_eye, to_eye)
        count += facing & inside & open_
    return count


def surface_errors(model: TexturedMesh | ColoredMesh, truth: TruePoints) -> Errors:
    """Errors at the points. The model has the scan's faces in their order."""
    return _summed([color_at(model, truth)], [truth.light], [truth.seen_by])


def picture_errors(
    model: TexturedMesh | ColoredMesh, truth: tuple[TrueView, ...], renderer: Renderer
) -> Errors:
    """Errors in the pictures."""
    shown = [render_model(renderer, model, view.camera) for view in truth]
    colors = [linear_from_srgb(image[..., :3] / 255) for image in shown]
    seen = [
        np.where(image[..., 3] == 255, view.seen_by, np.minimum(view.seen_by, 0))
        for image, view in zip(shown, truth, strict=True)
    ]
    return _summed(colors, [view.light for view in truth], seen)


def color_at(model: TexturedMesh | ColoredMesh, points: TruePoints) -> np.ndarray:
    """(n, 3) linear colors of the model at the points: bilinear on the page, linear between
    vertices.
    """
    if isinstance(model, ColoredMesh):
        top = np.iinfo(model.colors.dtype).max
        linear = linear_from_srgb(model.colors[:, :3] / top)
        return np.einsum("nk,nkc->nc", points.at, linear[model.faces[points.face]])
    uv = np.einsum("nk,nkc->nc", points.at, model.uv[model.uv_faces[points.face]])
    page_of_point, out = model.page_of_face[points.face], np.zeros((len(uv), 3), np.float32)
    for number, page in enumerate(model.pages):
        here = page_of_point == number
        linear = linear_from_srgb(page[..., :3] / np.iinfo(page.dtype).max)
        x, y = uv[here, 0] * page.shape[1] - 0.5, (1 - uv[here, 1]) * page.shape[0] - 0.5
        rows = -(-here.sum() // 1000)  # remap takes no image of more than 32767 columns
        grid = np.zeros((2, rows * 1000), np.float32)
        grid[:, : len(x)] = x, y
        got = cv2.remap(linear, *grid.reshape(2, rows, 1000), cv2.INTER_LINEAR)
        out[here] = got.reshape(-1, 3)[: len(x)]
    return out


def delta_e(linear: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """CIEDE2000 between (..., 3) linear colors (sRGB primaries)."""
    a, b = (rgb2lab(srgb_from_linear(np.clip(v, 0, 1))) for v in (linear, truth))
    return deltaE_ciede2000(a, b)


def _summed(colors: list, lights: list, seen: list) -> Errors:
    counted = [s > 0 for s in seen]
    color = np.concatenate([c[k] for c, k in zip(colors, counted, strict=True)])
    light = np.concatenate([c[k] for c, k in zip(lights, counted, strict=True)])
    gain = float(np.exp(np.median(np.log((light.mean(1) + 1e-4) / (color.mean(1) + 1e-4)))))
    error = delta_e(color * gain, light)
    possible = sum(np.count_nonzero(s >= 0) for s in seen)
    return Errors(
        float(np.median(error)), float(np.quantile(error, 0.95)), gain, len(error) / possible
    )


def rounds() -> dict[str, Defects]:
    """The set without defects, with each of them alone, and with all."""
    names = ("exposure", "vignetting", "visitor", "defocus", "highlight")
    alone = {name: replace(NO_DEFECTS, **{name: True}) for name in names}
    return {"none": NO_DEFECTS, **alone, "all": Defects()}


def made(defects: Defects, faces: int = COARSE) -> tuple[Synthetic, Scene]:
    """Photos with those defects beside a scan of so many faces (`TRUE`: the true surface itself),
    and the lit piece without gloss. The photos are those beside the coarse scan; `albedo` and
    `shaded` too.
    """
    data = exposure_round() if defects == Defects() else exposure_round(defects=defects)
    scene = replace(round_scene(), gloss=0.0)
    if faces == TRUE:
        mesh = Mesh(scene.caster.vertices.astype(float), scene.caster.faces)
        return replace(data, mesh=mesh), scene
    return (data if faces == COARSE else replace(data, mesh=scan_of(faces=faces))), scene

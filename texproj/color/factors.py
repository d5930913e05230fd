"""The factors of each photo's weight, one by one, for looking at why it counts where it does.

Made by the functions of coloring, at any points: those that the pixels of a photo show, or the
vertices of the mesh.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from texproj.arrays import Floats
from texproj.camera import Camera
from texproj.color.balance.corrections import corrected, gains_of, grids_of
from texproj.color.balance.focus import solve_photos
from texproj.color.balance.shared_points import PointObserver
from texproj.color.blending.combine import blend
from texproj.color.blending.highlights import highlight_factor
from texproj.color.points.source import Chunk, PointSource
from texproj.color.sampling.gather import Progress, counting, project_views
from texproj.color.sampling.part import Unusable
from texproj.color.sampling.photo_set import PhotoSet
from texproj.color.sampling.pixel_lookup import depth_pixels, photo_pixels, rescaled
from texproj.color.sampling.prepare import silhouette_feather_px, view_of
from texproj.color.sampling.store import Stack
from texproj.color.sampling.view import WHITE, PhotoView, linear16
from texproj.color.weights.names import FACTORS
from texproj.color.weights.picture import picture_factors, silhouette_factor
from texproj.color.weights.surface import MIN_COS_ANGLE, facing, resolution, surface_factors
from texproj.opencv import opencv_places
from texproj.options import ColorOptions
from texproj.photo import Photo
from texproj.resources.scratch import Scratch


@dataclass(frozen=True, eq=False)
class Inspection:
    """What to look at, and with what: the color stage's own arguments.

    photos: with their depth images.
    """

    points: PointSource
    photos: PhotoSet
    options: ColorOptions
    scratch: Scratch


def photo_factors(
    job: Inspection, wanted: Mapping[int, Sequence[int]], progress: Progress | None = None
) -> tuple[dict[int, dict[str, Floats]], tuple[Unusable, ...]]:
    """For each wanted photo the factors by name (see `FACTORS`) at the points of the chunks that
    it is wanted for, one after the other; and the photos that could not be used. Back faces and
    what is hidden have the weight 0.

    All photos are looked at once, since focus and consistency are judged against the others.
    """
    found: dict[int, dict[str, Floats]] = {}
    photos, count = job.photos, len(job.photos)

    def views() -> Iterator[PhotoView | Unusable]:
        for number, camera in enumerate(photos.cameras):
            photo = photos.photo(number)
            if isinstance(photo, Unusable):
                yield photo
                continue
            view = view_of(photo, camera, *photos.depth_image(number), job.options)
            if number in wanted:
                chunks = [job.points.chunk(k) for k in wanted[number]]
                parts = [own_factors(photo, view, job, chunk) for chunk in chunks]
                found[number] = {k: np.concatenate([p[k] for p in parts]) for k in parts[0]}
            yield view

    observer = PointObserver(job.points, count, job.options.focus_power > 0)
    tell = counting(progress, count)
    projected = project_views(job.points, views(), observer, job.options, job.scratch, tell)
    store = projected.samples
    light, focus = solve_photos(observer.shared(), job.options)
    gains, grids = gains_of(light.corrections), grids_of(photos.cameras, light.corrections)
    for number, factors in found.items():
        parts = []
        for k in wanted[number]:
            chunk = job.points.chunk(k)
            for rows in store.pieces(k):
                stack = corrected(store.read(k, rows), job.points, k, grids, rows)
                trust = picture_at(
                    focus[number].trust, photos.cameras[number], job.points, chunk.part(rows)
                )
                parts.append({"focus": trust, **shared_factors(stack, number, gains, job.options)})
        factors |= {k: np.concatenate([p[k] for p in parts]) for k in parts[0]}
    ordered = {number: {k: v[k] for k in FACTORS if k in v} for number, v in found.items()}
    return ordered, projected.failed


def own_factors(photo: Photo, view: PhotoView, job: Inspection, chunk: Chunk) -> dict[str, Floats]:
    """(n,) factors that a photo has by itself; those of the picture are 0 outside of it."""
    owners = job.points.owners
    cosine = facing(owners, view.camera)
    seen = cosine > np.float32(MIN_COS_ANGLE)
    surface = surface_factors(
        np.where(seen, cosine, np.float32(1)), resolution(owners, view.camera), job.options
    )
    out = {k: np.where(seen, v, np.float32(0))[chunk.owner] for k, v in surface.items()}
    in_depth, _ = depth_pixels(chunk.xyz, owners.origin, view.depth_camera)
    xy_px = photo_pixels(in_depth, view)
    small = view.levels[1] if len(view.levels) > 1 else linear16(photo.pixels)
    for name, image in picture_factors(photo, small, WHITE, job.options).items():
        maps = rescaled(xy_px, image.shape, view.camera)
        out[name] = cv2.remap(image, maps, None, cv2.INTER_LINEAR).reshape(-1)[: len(chunk)]
    feather = silhouette_feather_px(view.camera, view.depth_camera, job.options)
    image = silhouette_factor(view.depth, view.depth_camera.intrinsics.fx, feather)
    out["silhouette"] = cv2.remap(image, in_depth, None, cv2.INTER_LINEAR).reshape(-1)[: len(chunk)]
    return out


def picture_at(image: Floats | None, camera: Camera, points: PointSource, chunk: Chunk) -> Floats:
    """(n,) values of an image that covers the photo, held constant outside; 1 for None."""
    if image is None:
        return np.ones(len(chunk), np.float32)
    small = camera.resized(image.shape[1], image.shape[0])
    in_image, _ = small.project(chunk.xyz + points.owners.origin)
    maps = opencv_places(in_image)
    rows = np.array_split(maps, -(-len(maps) // 30_000) or 1)
    values = [
        cv2.remap(image, part[None], None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)[0]
        for part in rows
    ]
    return np.concatenate(values)


def shared_factors(
    stack: Stack, photo: int, gains: Floats, options: ColorOptions
) -> dict[str, Floats]:
    """(n,) what depends on the other photos. consistency: 1 where the photo shows the color that
    was blended, half at a difference of `options.robust_scale` in square roots of linear light;
    weight: the product of all factors, 0 = unseen.
    """
    row = np.flatnonzero(stack.photos == photo)
    n = stack.weight.shape[1]
    if len(row) == 0:
        return dict.fromkeys(("highlight", "consistency", "weight"), np.zeros(n, np.float32))
    rgb = stack.rgb * gains[stack.photos][:, :, None]
    glint = highlight_factor(rgb, stack.weight, options.highlight)[row[0]]
    apart = np.sqrt(rgb[row[0]]) - np.sqrt(np.maximum(blend(stack, gains, options).rgb.T, 0))
    weight = stack.weight[row[0]]
    consistency = 1 / (1 + np.square(apart).sum(axis=0) / np.float32(options.robust_scale**2))
    consistency *= weight > 0
    return {
        "highlight": glint,
        "consistency": consistency,
        "weight": weight * glint * consistency,
    }

"""Registration by silhouette: the cameras from which the mesh has the object's outline
(Lensch, Heidrich and Seidel, "A silhouette-based algorithm for texture registration and
stitching", Graphical Models 2001); with no start at all, by a search over the full sphere.

An outline has few facts: many objects show the same one from the front and from behind. What is
inside of it, by structure or mutual information, decides between such cameras.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from texproj.arrays import Doubles, Mask
from texproj.camera import Camera, Intrinsics
from texproj.errors import RegistrationError
from texproj.mesh import Mesh
from texproj.options import SilhouetteOptions
from texproj.photo import Photo, PhotoInfo
from texproj.register.motion import motion_px
from texproj.register.outline.object_mask import object_mask
from texproj.register.outline.sphere_search import DISTINCT, views_with_outline
from texproj.register.picks.lens import DEFAULT_FOCAL
from texproj.render import GBuffer, Render
from texproj.solve.lm import LmOptions, Loss, minimize
from texproj.solve.silhouette import OutlineDistance, outline, signed_distance, xor_share

SEARCH_PX = 96
"""Longer side of the picture in which views are compared."""
COARSE_ROUNDS, FINE_ROUNDS = 5, 6
WORKING_PX = 320
"""Longer side of the picture in which views are fitted finely."""
FOLLOWED = 24
"""Views that are fitted coarsely, the likeliest of those compared."""
HYPOTHESES = 5
"""Views that are fitted finely, if they differ, and told apart by what is inside."""
MOST_POINTS = 500
LEAST_POINTS = 30
STEPS = LmOptions(max_iterations=12, cost_tolerance=1e-4)


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A camera from which the mesh has about the object's outline.

    camera: full size; xor: area between the two outlines, as a share of the object's.
    """

    camera: Camera
    xor: float


def guessed_lens(info: PhotoInfo) -> Intrinsics:
    """A lens for a photo of which nothing but its header is known."""
    focal = info.focal_px or DEFAULT_FOCAL * max(info.width, info.height)
    return Intrinsics(info.width, info.height, focal, focal, info.width / 2, info.height / 2)


def hypotheses(
    photo: Photo,
    prior: Camera | Intrinsics | None,
    render: Render,
    mesh: Mesh,
    options: SilhouetteOptions,
    mask: Mask | None = None,
) -> list[Hypothesis]:
    """Distinct cameras whose view of `mesh` has the outline of the photo's object, the best first;
    at least one.

    prior: a camera to start from, or only the lens (full size), or nothing; mask: (h, w) bool of
    any size, the object's pixels; by default the photo's own mask or an automatic one. Raises
    RegistrationError if there is no object mask or no view of the mesh has its outline.
    """
    start = prior if isinstance(prior, Camera) else None
    wanted = mask if mask is not None else object_mask(photo, _projected(start, render, photo))
    lens = prior.intrinsics if isinstance(prior, Camera) else prior or guessed_lens(photo.info)
    starts = [start] if start else _searched(wanted, lens, mesh, options)
    coarse = [fitted(s, wanted, render, SEARCH_PX, COARSE_ROUNDS) for s in starts]
    kept = _distinct(sorted(coarse, key=lambda h: h.xor), mesh, HYPOTHESES)
    fine = [fitted(h.camera, wanted, render, WORKING_PX, FINE_ROUNDS) for h in kept]
    if not fine:
        raise RegistrationError(
            f"{photo.info.name}: no view of the mesh has the object's outline "
            "(is the mask right? else pick 8 points)"
        )
    return _distinct(sorted(fine, key=lambda h: h.xor), mesh, HYPOTHESES)


def _projected(start: Camera | None, render: Render, photo: Photo) -> Mask | None:
    if start is None:
        return None
    images = render(start.resized(photo.width, photo.height))
    return np.isfinite(images.require("depth"))


def _searched(mask: Mask, lens: Intrinsics, mesh: Mesh, options: SilhouetteOptions) -> list[Camera]:
    small = _resized(mask, SEARCH_PX)
    height, width = small.shape
    views = views_with_outline(small, lens.resized(width, height), mesh, options.views, FOLLOWED)
    return [Camera(lens, v.camera.pose) for v in views]


def fitted(start: Camera, mask: Mask, render: Render, longest_px: int, rounds: int) -> Hypothesis:
    """The camera to which the outline pulls from `start`: render, fit, repeat."""
    wanted = _resized(mask, longest_px)
    height, width = wanted.shape
    camera = start.resized(width, height)
    distance, scale_px = signed_distance(wanted), 0.02 * longest_px
    best = Hypothesis(start, np.inf)
    for turn in range(rounds + 1):
        images = render(camera)
        solid = np.isfinite(images.require("depth"))
        xor = xor_share(solid, wanted)
        if xor < best.xor:
            best = Hypothesis(camera.resized(start.width, start.height), xor)
        points = _outline_points(solid, images, camera)
        if turn == rounds or len(points) < LEAST_POINTS:
            break
        problem = OutlineDistance(points, distance, expected_px=-0.5)
        loss = Loss("cauchy", max(scale_px / 2**turn, 1.0))
        camera = minimize(problem, camera, loss, STEPS).x
    return best


def _outline_points(solid: Mask, images: GBuffer, camera: Camera) -> Doubles:
    y, x = outline(solid)
    step = max(1, len(y) // MOST_POINTS)
    return images.points(camera, y[::step], x[::step])


def _resized(mask: Mask, longest_px: int) -> Mask:
    height, width = mask.shape
    factor = min(1.0, longest_px / max(height, width))
    size = (max(1, round(width * factor)), max(1, round(height * factor)))
    return cv2.resize(mask.astype(np.float32), size, interpolation=cv2.INTER_AREA) > 0.5


def _distinct(ranked: list[Hypothesis], mesh: Mesh, most: int) -> list[Hypothesis]:
    probes = mesh.vertices[:: max(1, len(mesh.vertices) // 200)]
    kept: list[Hypothesis] = []
    for h in ranked:
        near = DISTINCT * h.camera.width
        if np.isfinite(h.xor) and all(motion_px(h.camera, k.camera, probes) > near for k in kept):
            kept.append(h)
    return kept[:most]

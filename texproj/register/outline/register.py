"""Registration by silhouette: the camera from which the mesh has the object's outline
(Lensch, Heidrich and Seidel, "A silhouette-based algorithm for texture registration and
stitching", Graphical Models 2001); with no start at all, by a search over the full sphere.

An outline has few facts: many objects show the same one from the front and from behind. What is
inside of it, by structure or mutual information, decides between such cameras.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Doubles, Mask
from texproj.camera import Camera, Intrinsics
from texproj.errors import RegistrationError
from texproj.mesh import Mesh
from texproj.options import SilhouetteOptions
from texproj.photo import Photo, PhotoInfo
from texproj.records import Fit
from texproj.register.outline.object_mask import object_mask
from texproj.register.outline.sphere_search import DISTINCT, views_with_outline
from texproj.register.picks.lens import DEFAULT_FOCAL
from texproj.register.structure.starts import motion_px
from texproj.register.structure.view import Render
from texproj.solve.lm import LmFit, LmOptions, Loss, minimize
from texproj.solve.reprojection import projection_jacobian
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
MAX_XOR = 0.06
"""Area between the two outlines, as a share of the object's, above which a camera is refused."""
RIVAL = 1.5
"""A camera from elsewhere is a rival if its area is smaller than this many times the best."""
MOST_POINTS = 500
LEAST_POINTS = 30
CORRELATED_PX = 8.0
"""Length of outline along which its errors are the same."""
STEPS = LmOptions(max_iterations=12, cost_tolerance=1e-4)


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """camera: full size; xor: share of the area that differs; fit: of its last round, in pixels
    of its level; points: (n, 3) of the mesh's outline.
    """

    camera: Camera
    xor: float
    fit: LmFit[Camera] | None = None
    points: Doubles | None = None


def guessed_lens(info: PhotoInfo) -> Intrinsics:
    """A lens for a photo of which nothing but its header is known."""
    focal = info.focal_px or DEFAULT_FOCAL * max(info.width, info.height)
    return Intrinsics(info.width, info.height, focal, focal, info.width / 2, info.height / 2)


def register_silhouette(
    photo: Photo,
    prior: Camera | Intrinsics | None,
    render: Render,
    mesh: Mesh,
    options: SilhouetteOptions | None = None,
    mask: Mask | None = None,
) -> Fit:
    """The camera whose view of `mesh` has the outline of the photo's object.

    prior: a camera to start from, or only the lens (full size), or nothing; mask: (h, w) bool of
    any size, the object's pixels; by default the photo's own mask or an automatic one. Refused
    if other views have that outline too: `hypotheses` gives them all. Raises RegistrationError
    if there is no object mask or no view fits.
    """
    options = options or SilhouetteOptions()
    found = hypotheses(photo, prior, render, mesh, options, mask)
    best, rivals = found[0], rivals_of(found)
    return _fit(best, len(rivals), options)


def hypotheses(
    photo: Photo,
    prior: Camera | Intrinsics | None,
    render: Render,
    mesh: Mesh,
    options: SilhouetteOptions,
    mask: Mask | None = None,
) -> list[Hypothesis]:
    """Distinct cameras that have the outline, the best first; at least one."""
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
            "(is the mask right? else pick 4 points)"
        )
    return _distinct(sorted(fine, key=lambda h: h.xor), mesh, HYPOTHESES)


def rivals_of(found: list[Hypothesis]) -> list[Hypothesis]:
    """Those after the first whose outline is about as good."""
    return [h for h in found[1:] if h.xor < RIVAL * found[0].xor]


def _projected(start: Camera | None, render: Render, photo: Photo) -> Mask | None:
    if start is None:
        return None
    images = render(start.resized(photo.width, photo.height))
    assert images.depth is not None
    return np.isfinite(images.depth)


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
    fit: LmFit[Camera] | None = None
    points: Doubles | None = None
    for turn in range(rounds + 1):
        images = render(camera)
        assert images.depth is not None
        solid = np.isfinite(images.depth)
        xor = xor_share(solid, wanted)
        if xor < best.xor:
            best = Hypothesis(camera.resized(start.width, start.height), xor, fit, points)
        points = _outline_points(solid, images.depth, camera)
        if turn == rounds or len(points) < LEAST_POINTS:
            break
        problem = OutlineDistance(points, distance, expected_px=-0.5)
        fit = minimize(problem, camera, Loss("cauchy", max(scale_px / 2**turn, 1.0)), STEPS)
        camera = fit.x
    return best


def _outline_points(solid: Mask, depth: NDArray[np.float32], camera: Camera) -> Doubles:
    y, x = outline(solid)
    step = max(1, len(y) // MOST_POINTS)
    y, x = y[::step], x[::step]
    return camera.unproject(np.stack([x, y], axis=1) + 0.5, depth[y, x])


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


def _fit(best: Hypothesis, rivals: int, options: SilhouetteOptions) -> Fit:
    camera, fit, points = best.camera, best.fit, best.points
    if fit is None or points is None:
        covariance, error = np.full((6, 6), np.inf), float("inf")
        residual = np.zeros(0)
    else:
        scale = camera.width / fit.x.width
        covariance = fit.covariance() * CORRELATED_PX
        jacobian = projection_jacobian(fit.x, points)
        spread = np.einsum("nip,pq,niq->n", jacobian, covariance, jacobian).mean()
        error = float(np.sqrt(spread)) * scale
        residual = np.abs(fit.residual[:, 0]) * scale
    reason = _refusal(best, rivals, 100 * error / max(camera.width, camera.height), options)
    return Fit(
        camera=camera, method="silhouette", expected_error_px=error, residual_px=residual,
        inliers=residual < 3 * max(float(np.median(residual)) if len(residual) else 0.0, 1e-9),
        covariance=covariance, accepted=not reason, reason=reason,
        quality={"xor": round(best.xor, 4), "rivals": rivals},
    )  # fmt: skip


def _refusal(
    best: Hypothesis, rivals: int, error_percent: float, options: SilhouetteOptions
) -> str:
    if best.xor > MAX_XOR:
        return (
            f"the best outline found differs by {best.xor:.0%} of the object's area "
            "(is the mask right, and the object whole in the picture?)"
        )
    if rivals:
        return (
            f"{rivals + 1} different views have this outline (give a rough camera, or pick 4 "
            "points)"
        )
    if error_percent > options.max_error_percent:
        return (
            f"the outline leaves the camera uncertain by {error_percent:.1f} % of the longer side "
            "(pick 4 points)"
        )
    return ""

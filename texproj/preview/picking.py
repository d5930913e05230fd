"""What helps a person to pick: the camera that the picks give, where the other half of a pick is
predicted, and the strongest match near there.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.camera import Camera
from texproj.errors import RegistrationError, UsageError
from texproj.formats.camera_bounds import checked_intrinsics, checked_pose
from texproj.photo import Correspondences, Photo
from texproj.preview.photos import camera_facts
from texproj.preview.surface import Hit, Surface
from texproj.project import Project
from texproj.records import Fit
from texproj.register.picks.register import examine_points
from texproj.solve.matching import match_patches
from texproj.solve.orientation import photo_field, render_field
from texproj.stages.entries import start_of

MATCH_LONGEST = 1600
"""Longer side in pixels to which a photo is reduced before a match is sought."""

PATCH_PX = 41
"""Edge of the square that is compared, in pixels of the reduced photo."""

SEARCH_PX = 16
"""How far from the prediction a match is sought, in pixels of the reduced photo."""

LEAST_SEARCH_PX = 3
"""The same for a camera that is known well: a match on the rim of the search is none."""

SNAP_SCORE = 0.45
"""Correlation of orientation fields below which the prediction itself is kept."""


@dataclass(frozen=True, eq=False)
class Prediction:
    """The other half of a pick. score: correlation of the match it was moved to, 0 = not moved."""

    xy_px: NDArray[np.float64]
    hit: Hit
    score: float

    def as_dict(self) -> dict[str, Any]:
        return {"uv": self.xy_px.tolist(), **self.hit.as_dict(), "score": round(self.score, 3)}


def fit_picks(
    project: Project, name: str, picks: Correspondences, without: Collection[str] = ()
) -> dict[str, Any]:
    """The camera that these picks give and how far off each is, as the page draws it; where they
    are refused, the camera that comes nearest, and why it is none.

    without: names of picks that are left out of the fit. Raises RegistrationError where no camera
    comes near.
    """
    used = np.array([n not in without for n in picks.names], bool)
    kept = tuple(n for n in picks.names if n not in without)
    chosen = Correspondences(picks.xy_px[used], picks.xyz_in_world[used], kept)
    fit, rough = _fit_or_nearest(project, name, chosen)
    projected, _ = fit.camera.project(picks.xyz_in_world)
    inliers = np.zeros(len(picks), bool)
    inliers[used] = fit.inliers
    residual_px = np.hypot(*(projected - picks.xy_px).T)
    return {
        "camera": camera_facts(fit.camera),
        "expected_error_px": finite(fit.expected_error_px),
        "accepted": fit.accepted,
        "rough": rough,
        "reason": fit.reason.removeprefix(f"{name}: "),
        "names": list(picks.names),
        "projected": [[finite(u), finite(v)] for u, v in projected],
        "residual_px": [finite(r) for r in residual_px],
        "inliers": [bool(ok) for ok in inliers],
        "used": [bool(ok) for ok in used],
    }


def _fit_or_nearest(project: Project, name: str, picks: Correspondences) -> tuple[Fit, bool]:
    """The fit of picks, not accepted where they are refused, and whether it is then good enough
    to say where other points lie.
    """
    start = start_of(project.load_cameras().get(name))
    prior = start.intrinsics if start else None
    pose = start.pose if start else None
    info, options = project.photo_info(name), project.settings.points
    fit, refusal = examine_points(info, picks, prior, options, pose)
    if fit is None:
        raise refusal or RegistrationError(f"{name}: no camera")
    return fit, refusal is not None and refusal.approximate is not None


def finite(value: float) -> float | None:
    """The number, or None where JSON has no word for it."""
    return float(value) if np.isfinite(value) else None


def predict_on_model(
    surface: Surface, photo: Photo, camera: Camera, xy_px: NDArray[np.float64]
) -> Prediction | None:
    """The surface point that a pixel of the full-size photo shows; None beside the model."""
    hit = _seen(surface, camera, xy_px)
    if hit is None:
        return None
    moved, score = _moved(surface, photo, camera, xy_px, True)
    better = _seen(surface, camera, moved) if score else None
    return Prediction(xy_px, better or hit, score if better else 0.0)


def predict_on_photo(
    surface: Surface,
    photo: Photo,
    camera: Camera,
    xyz: NDArray[np.float64],
    within_px: float = np.inf,
) -> Prediction | None:
    """The pixel of the full-size photo that shows a surface point; None outside of the photo.

    within_px: how far off the camera may be, full-size pixels; no match is sought beyond.
    """
    xy_px = camera.project(xyz[None])[0][0]
    if not camera.inside(xy_px):
        return None
    normal = surface.nearest_normals(xyz[None])[0]
    moved, score = _moved(surface, photo, camera, xy_px, False, within_px)
    return Prediction(moved if score else xy_px, Hit(xyz, normal, -1), score)


def _seen(surface: Surface, camera: Camera, xy_px: NDArray[np.float64]) -> Hit | None:
    """The front of the surface at a pixel, None where there is none or a back hides it."""
    origins, directions = camera.rays(xy_px[None])
    if not np.isfinite(directions).all():
        return None
    hit = surface.hit(origins[0], directions[0])
    return None if hit is None or hit.back else hit


def _moved(
    surface: Surface,
    photo: Photo,
    camera: Camera,
    xy_px: NDArray[np.float64],
    on_model: bool,
    within_px: float = np.inf,
) -> tuple[NDArray[np.float64], float]:
    """`xy_px` moved to where model and photo agree best around it, and the correlation there
    (0 = nothing agreed well enough, not moved). `on_model`: look for the photo's patch on the
    model, else for the model's patch in the photo.
    """
    small = camera.resized(photo.width, photo.height)
    scale = np.array([photo.width / camera.width, photo.height / camera.height])
    corner = np.floor(xy_px * scale).astype(int) - WINDOW_PX // 2
    of_photo = photo_field(_cut(photo.gray(), corner))
    of_model = _model_field(surface, small, corner)
    image, template = (of_model, of_photo) if on_model else (of_photo, of_model)
    middle = np.array([[WINDOW_PX // 2, WINDOW_PX // 2]])
    radius = int(np.clip(np.ceil(within_px * scale.max()), LEAST_SEARCH_PX, SEARCH_PX))
    found = match_patches(template, image, middle, PATCH_PX, radius)
    if not len(found) or found.score[0] < SNAP_SCORE:
        return xy_px, 0.0
    return xy_px + (found.target_px[0] - found.source_px[0]) / scale, float(found.score[0])


WINDOW_PX = 2 * (PATCH_PX // 2 + SEARCH_PX) + 1


def _cut(gray: NDArray[np.float32], corner: NDArray[np.intp]) -> NDArray[np.float32]:
    """The window at `corner`; beyond the photo its border is repeated."""
    matrix = np.array([[1, 0, -corner[0]], [0, 1, -corner[1]]], float)
    size = (WINDOW_PX, WINDOW_PX)
    return cv2.warpAffine(
        gray, matrix, size, flags=cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE
    )


def _model_field(
    surface: Surface, camera: Camera, corner: NDArray[np.intp]
) -> NDArray[np.complex64]:
    """Orientation field of the model's normals and depth in the window at `corner`."""
    x, y = np.meshgrid(np.arange(WINDOW_PX), np.arange(WINDOW_PX))
    pixels = np.stack([x.ravel(), y.ravel()], axis=1) + corner + 0.5
    origins, directions = camera.rays(pixels)
    directions = np.nan_to_num(directions)
    face = surface.first_hits(origins, directions)
    normals = np.where(face[:, None] >= 0, surface.normals_of(face) @ camera.pose.R.T, 0)
    channels = [np.ascontiguousarray(c, np.float32).reshape(x.shape) for c in normals.T]
    valid = cv2.erode((face >= 0).astype(np.uint8).reshape(x.shape), np.ones((5, 5), np.uint8))
    return render_field(channels, valid > 0)


def parse_camera(data: Any) -> Camera:
    """A camera as the page sends it back. Raises InputError, UsageError for anything else."""
    if not isinstance(data, dict):
        raise UsageError("expected a camera")
    width, height, focal, center, dist, R, t = (data.get(key) for key in CAMERA_KEYS)
    found = checked_intrinsics(width, height, _list(focal), _list(center), _list(dist), "camera")
    return Camera(found, checked_pose(_list(R), _list(t), "camera"))


CAMERA_KEYS = ("width", "height", "f", "c", "dist", "R", "t")


def _list(value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise UsageError(f"a camera needs lists for {', '.join(CAMERA_KEYS[2:])}")
    return value

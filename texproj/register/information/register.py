"""Registration by mutual information: the camera from which normals and ambient occlusion of the
bare mesh tell most about the photo (Corsini, Dellepiane, Ponchio and Scopigno, Pacific Graphics
2009). Right for objects of one material under any light; needs a start within a few percent.

Unlike the original, which renders for every evaluation, the rendering's points are projected
into the photo until the camera has moved far enough to render again (ours).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from texproj.arrays import Doubles
from texproj.camera import Camera, Pose
from texproj.errors import RegistrationError
from texproj.options import MutualInformationOptions
from texproj.photo import Correspondences, Photo
from texproj.records import Fit
from texproj.register.information.comparison import Comparison
from texproj.register.information.search import (
    COARSE,
    FINE,
    MIDDLE,
    PICK_SCALE,
    Outcome,
    Task,
    ascend,
    moved,
    objective,
    settled,
)
from texproj.register.motion import motion_px
from texproj.register.structure.mirror import mirrored_camera
from texproj.register.structure.verdict import Verdict, verify
from texproj.render import Render
from texproj.solve.pose_search import CameraSteps, curvature
from texproj.solve.reprojection import displacement_variance, projection_jacobian

RESTARTS, ASIDE = 2, 0.01
"""Searches that start again beside the result, and how far, as a share of the width."""
AGREED = 0.005
"""Distance between their ends, as a share of the width, that still counts as the same."""
FLAT = 0.1
"""Largest curvature, nats per squared pixel, below which there is no peak."""
SYSTEMATIC = 0.001
"""What light from one side shifts, as a share of the width (synthetic matte objects)."""
LEAST_SUPPORT, ENOUGH_PATCHES = 0.1, 100
"""Share of structure in place below which the result is by chance, if there are so many patches."""
MIRROR_MARGIN = 1.04
"""How much more the mesh must tell about the photo than about its mirror image: 1.05 and more for
right photos of nearly symmetric pieces; .97 and less for mirrored ones where the search for the
mirror image succeeds (synthetic)."""
MIRROR_TURNS_DEG, MIRRORED_FOLLOWED = (-16.0, -8.0, 0.0, 8.0, 16.0), 2
"""Planes of symmetry that are tried, from the front's normal, and how many are followed up."""
CURVATURE_RADIUS_PX, LEAST_CURVATURE = 4.0, 0.05
"""Where the peak's shape is measured, and its least curvature relative to the largest: less is
the roughness of the measure, not a direction in which nothing is known."""


def register_mutual_information(
    photo: Photo,
    prior: Camera,
    render: Render,
    options: MutualInformationOptions | None = None,
    picks: Correspondences | None = None,
) -> Fit:
    """The camera of `photo` uphill from `prior` (full size), and whether to believe it.

    photo: may be reduced, its mask is respected; render: depth, normal, ambient occlusion (and
    front) of the mesh for a camera; picks: full-size pixels, joined with the information by
    their weights (after Sottile et al., "Mutual correspondences", 2010, but both terms are log
    likelihoods, so that neither needs a factor). Raises RegistrationError if the mesh is not in
    view from the start.
    """
    task = Task(photo, render, options or MutualInformationOptions(), picks)
    before = _required(task, prior)
    found = settled(task, ascend(task, prior, (*COARSE, *MIDDLE)))
    shown = _required(task, found.camera)
    ends = [_restarted(task, shown, found.camera, seed) for seed in range(RESTARTS)]
    apart = tuple(motion_px(e, found.camera, shown.points[::40]) / prior.width for e in ends)
    if max(apart) < AGREED:
        found = replace(found, camera=_mean([found.camera, *ends]))
        shown = _required(task, found.camera)
    verdict = verify(photo, found.camera, render)
    mirrored = _mirrored_bits(task, found.camera)
    proof = Evidence(before.information(before.camera), found, apart, verdict, mirrored)
    return _fit(task, shown, proof)


def _required(task: Task, camera: Camera) -> Comparison:
    comparison = task.comparison(camera, 1.0)
    if comparison is None:
        raise RegistrationError(
            f"{task.photo.info.name}: too little of the mesh is in view of the start camera "
            "(give a closer start, or pick 8 points)"
        )
    return comparison


def _restarted(task: Task, shown: Comparison, camera: Camera, seed: int) -> Camera:
    """Where the search ends from a place beside `camera`."""
    steps = CameraSteps.around(shown.camera, shown.points[::40])
    aside = np.random.default_rng(seed).standard_normal(steps.count)
    aside *= ASIDE * shown.camera.width / np.linalg.norm(aside)
    return ascend(task, moved(camera, steps, aside), (*MIDDLE, FINE)).camera


def _mirrored_bits(task: Task, camera: Camera) -> float:
    """Most information about the mirrored photo, from the mirror images of `camera` uphill."""
    photo = task.photo
    flipped = replace(
        photo,
        pixels=cv2.flip(photo.pixels, 1),
        mask=None if photo.mask is None else cv2.flip(photo.mask, 1),
    )
    turned = replace(task, photo=flipped, picks=None)
    ends = [ascend(turned, start, COARSE) for start in _mirror_images(task, camera)]
    best = sorted(ends, key=lambda end: end.information)[-MIRRORED_FOLLOWED:]
    return max(ascend(turned, end.camera, (*MIDDLE, FINE)).information for end in best)


def _mirror_images(task: Task, camera: Camera) -> list[Camera]:
    """`camera` mirrored at upright planes through the middle of the object's front: along the
    normal that most of what is seen shares, and turned from there, since an oblique view tells
    little of how an object is symmetric.
    """
    here = camera.scaled(0.25)
    images = task.render(here)
    solid = np.isfinite(images.require("depth"))
    xyz = images.points(here, *np.nonzero(solid))
    middle = np.median(camera.pose.apply(xyz), axis=0)
    normal = images.require("normal")[solid].astype(np.float64)
    front = np.linalg.eigh(normal.T @ normal)[1][:, -1]
    front *= np.sign(front @ normal.mean(axis=0)) or 1.0
    turns = [cv2.Rodrigues(np.array([0.0, np.radians(deg), 0.0]))[0] for deg in MIRROR_TURNS_DEG]
    return [mirrored_camera(camera, middle, turn @ front) for turn in turns]


def _mean(cameras: list[Camera]) -> Camera:
    """Of cameras that hardly differ."""
    U, _, Vt = np.linalg.svd(np.mean([c.pose.R for c in cameras], axis=0))
    t = np.mean([c.pose.t for c in cameras], axis=0)
    zoom = float(np.exp(np.mean([np.log(c.intrinsics.fx) for c in cameras])))
    k = cameras[0].intrinsics
    return Camera(replace(k, fx=zoom, fy=zoom * k.fy / k.fx), Pose(U @ Vt, t))


@dataclass(frozen=True, eq=False)
class Evidence:
    """What speaks for a camera. before_bits: information at the start; apart: where restarts
    ended, shares of the width; verdict: of structure matching; mirrored_bits: what the mesh
    tells about the photo with left and right exchanged.
    """

    before_bits: float
    found: Outcome
    apart: tuple[float, ...]
    verdict: Verdict
    mirrored_bits: float


def _refusal(proof: Evidence, error_percent: float, options: MutualInformationOptions) -> str:
    """Why the camera is not to be believed; empty if it is."""
    again = "(give a closer start, a mask of the object, or pick 8 points)"
    if max(proof.apart) > AGREED:
        return f"searches from close by end {max(proof.apart):.1%} of the width apart {again}"
    if proof.verdict.support < LEAST_SUPPORT and proof.verdict.patches >= ENOUGH_PATCHES:
        return (
            f"only {proof.verdict.support:.0%} of the mesh's structure is where this camera puts "
            f"it, so its shading matches by chance {again}"
        )
    if MIRROR_MARGIN * proof.mirrored_bits > proof.found.information:
        return (
            "the photo fits as well with left and right exchanged (is it a mirrored scan? "
            "else pick 8 points)"
        )
    if error_percent > options.max_error_percent:
        return f"the expected error is {error_percent:.1f} % of the longer side {again}"
    return ""


def _fit(task: Task, shown: Comparison, proof: Evidence) -> Fit:
    camera = proof.found.camera
    covariance = _covariance(task, shown, camera)
    free = ("focal",) if task.options.focal else ()
    jacobian = projection_jacobian(camera, shown.points[::40], free)
    spread = float(displacement_variance(jacobian, covariance).mean())
    scattered = np.mean(np.square(proof.apart)) / (1 + RESTARTS)  # of the mean of all ends
    error = camera.width * float(np.sqrt(spread / camera.width**2 + scattered + SYSTEMATIC**2))
    reason = _refusal(proof, 100 * error / max(camera.width, camera.height), task.options)
    picks = task.picks
    residual = np.zeros(0)
    if picks is not None:
        residual = np.linalg.norm(camera.project(picks.xyz_in_world)[0] - picks.xy_px, axis=1)
    sigma = task.options.pick_sigma_percent / 100 * max(camera.width, camera.height)
    return Fit(
        camera=camera, method="mutual-information", expected_error_px=error,
        residual_px=residual, inliers=residual < PICK_SCALE * 2 * sigma, covariance=covariance,
        solved=("rotation", "translation", *free), names=picks.names if picks else (),
        accepted=not reason, reason=reason, quality=_quality(proof),
    )  # fmt: skip


def _quality(proof: Evidence) -> dict[str, Any]:
    return {
        "information_before_bits": round(proof.before_bits, 4),
        "information_bits": round(proof.found.information, 4),
        "evaluations": proof.found.evaluations,
        "information_mirrored_bits": round(proof.mirrored_bits, 4),
        "restarts_apart_percent": [round(100 * apart, 3) for apart in proof.apart],
        "support": round(proof.verdict.support, 3),
        "agreement": round(proof.verdict.agreement, 3),
        "coverage": round(proof.verdict.coverage, 3),
    }


def _covariance(task: Task, shown: Comparison, camera: Camera) -> Doubles:
    """(p, p) of rotation, translation (and log focal) as `Pose.step`: how sharp the peak is."""
    steps = CameraSteps.around(shown.camera, shown.points[::40], task.options.focal)
    bend = -curvature(objective(task, shown, steps, camera), steps.count, CURVATURE_RADIUS_PX)
    try:
        values, vectors = np.linalg.eigh(bend)
    except np.linalg.LinAlgError:
        return np.full_like(bend, np.inf)
    in_steps = (vectors / np.maximum(values, LEAST_CURVATURE * max(values[-1], FLAT))) @ vectors.T
    to_delta = steps.pose_delta()
    return to_delta @ in_steps @ to_delta.T

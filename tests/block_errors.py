"""How far the cameras of a block are from true ones, the frame of the block apart."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.optimize import least_squares

from texproj.camera import Camera
from texproj.register.block.reconstruction import Reconstruction
from texproj.register.block.similarity import Similarity


def visible(camera: Camera, xyz: np.ndarray, most: int = 300) -> np.ndarray:
    """Some of the points (n, 3) that have an image inside the picture."""
    inside = np.flatnonzero(camera.inside(camera.project(xyz)[0]))
    return xyz[inside[:: max(1, len(inside) // most)]]


def offsets_px(found: Camera, true: Camera, xyz: np.ndarray) -> np.ndarray:
    """(n,) distances between two cameras' images of points; the width where there is none."""
    gap = np.linalg.norm(found.project(xyz)[0] - true.project(xyz)[0], axis=1)
    return np.where(np.isfinite(gap), gap, found.width)


def errors_px(block: Reconstruction, truth: Mapping[str, Camera], xyz: np.ndarray) -> np.ndarray:
    """(p,) median distance in each photo between the images of world points (n, 3) by the true
    camera and by the block's, the best similarity common to all photos taken out.
    """
    true = [truth[name] for name in block.names]
    seen = [visible(camera, xyz) for camera in true]
    placed = best_similarity(block.cameras, true, seen)
    sets = zip(block.cameras, true, seen, strict=True)
    return np.array([np.median(offsets_px(placed.camera(a), b, points)) for a, b, points in sets])


def best_similarity(found, true, seen) -> Similarity:
    """The one that brings `found` cameras nearest to the `true` ones, in the pictures."""
    start = by_centers(found, true)
    pivot = np.concatenate(seen).mean(axis=0)
    unit = float(np.linalg.norm(true[0].center - pivot))

    def residuals(delta):
        placed = start.step(delta, pivot, unit)
        sets = zip(found, true, seen, strict=True)
        return np.concatenate([offsets_px(placed.camera(a), b, xyz) for a, b, xyz in sets])

    best = least_squares(
        residuals, np.zeros(7), loss="soft_l1", f_scale=1.0, x_scale=1e-3, diff_step=1e-6
    )
    return start.step(best.x, pivot, unit)


def by_centers(found, true) -> Similarity:
    """A first guess: mean rotation, then scale and shift by the centers."""
    turns = np.sum([b.pose.R.T @ a.pose.R for a, b in zip(found, true, strict=True)], axis=0)
    u, _, vt = np.linalg.svd(turns)
    R = u @ np.diag([1, 1, np.sign(np.linalg.det(u @ vt))]) @ vt
    a, b = (np.array([camera.center for camera in cameras]) for cameras in (found, true))
    scale = np.linalg.norm(b - b.mean(axis=0)) / np.linalg.norm(a - a.mean(axis=0))
    return Similarity(scale, R, b.mean(axis=0) - scale * R @ a.mean(axis=0))

"""A placed block, adjusted in one least squares with all that is known of it: sightings of its
points, the mesh on which these lie, and what is said of single photos.

What is said of a photo by its picks, by a camera that was registered or imported, or by the search
for the block's place, counts by its noise, and as a whole no more once the rest contradicts it
(Geman and McClure's loss). It is told in pixels of points of the surface, so a focal length that is
confused with a distance does no harm. Method: ours.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from texproj.arrays import Bools, Doubles, Index
from texproj.camera import Camera
from texproj.register.block.anchor import BLOCK_ERROR
from texproj.register.block.reconstruction import Reconstruction
from texproj.register.block.said import Said
from texproj.register.block.scan_samples import ScanSamples
from texproj.solve.bundle import (
    Adjusted,
    Bundle,
    Cameras,
    KnownPoints,
    Planes,
    Tracks,
    adjust,
    track_residuals,
)
from texproj.solve.reprojection import displacement_variance, intrinsic_value, projection_jacobian
from texproj.solve.shared_lens import LensParameters, SharedIntrinsics

CELLS, IN_A_CELL = 10, 2
"""Each picture is divided in so many rows and columns, and of each cell so many points take part,
those that most photos saw: more of one corner only repeat its errors, and take time."""
LEAST_TRACK_PX = 0.25
"""Noise of a sighting, full-size pixels: no smaller one is believed."""
FOCAL_SIGMA, RADIAL_SIGMA, CENTER_SIGMA = 0.02, 0.05, 0.02
"""What is known of a lens beside the photos: of its focal length, relative; of k1; of the principal
point, as a part of the width."""
REACHES = (0.03, 0.03, 0.02, 0.02, 0.015, 0.015)
"""Distance, sizes of the block, up to which points belong to the surface, round by round."""
STEPS = 4
"""Of the least squares in each round."""
LEAST_SIGMA = 2e-4
"""No scan is known better, sizes of the block."""
LEAST_ON_SURFACE = 50
"""Points on the mesh with fewer of which nothing is concluded."""
PLANES_SHARE, TRACKS_SHARE = 20.0, 2.0
"""How many points share an error of the scan's shape, and how many sightings one of the features:
so much less each counts, the second in the deviations only."""
DOUBT = 3.0
"""Standard deviations at which half of what is said of a photo is not believed any more."""
APART, LEAST_APART = 3.0, 2e-3
"""Standard deviations, and widths of the photo, beyond which it is contradicted."""
MEDIAN_SQUARE = 1.386
"""Median of the squared length of a normal vector of two numbers."""


@dataclass(frozen=True, eq=False)
class Bundled:
    """cameras: of the block's photos, world, full size; expected_error_px: (p,) one standard
    deviation of the surface in each, by the covariance; contradicted: (said,) what the rest
    contradicts; apart_px: (said,) median distance of what is said from where the photo shows it;
    on_surface: share of the points that lie on the mesh.
    """

    cameras: Cameras
    expected_error_px: Doubles
    contradicted: Bools
    apart_px: Doubles
    on_surface: float


def bundled(
    block: Reconstruction,
    cameras: Sequence[Camera],
    points: Doubles,
    samples: ScanSamples,
    said: Sequence[Said],
    calibrated: Collection[str] = (),
) -> Bundled | None:
    """The photos of `block` adjusted from where it was placed; None where too few of its points
    meet the mesh to tell.

    cameras: (p,) world, full size; points: (n, 3) the block's, world; samples: of the mesh;
    calibrated: names of the photos whose lens was given.
    """
    chosen = _covering(block)
    tracks = _tracks(block, chosen, tuple(cameras), points[chosen])
    lenses = _lenses(block, cameras, calibrated)
    here = Adjusted(tuple(cameras), points[chosen], np.inf, np.zeros((0, 0)))
    unit = float(np.median(np.linalg.norm(here.points - np.median(here.points, axis=0), axis=1)))
    rows = [block.names.index(one.name) for one in said]
    trust = np.ones(len(said))
    for reach in REACHES:
        planes = _planes(block, chosen, here, samples, reach * unit, LEAST_SIGMA * unit)
        if planes is None:
            return None
        problem = Bundle(tracks, planes, _known(said, rows, trust), lenses)
        here = adjust(problem, here.cameras, here.points, STEPS)
        trust = _trust(said, rows, here.cameras)
    return _concluded(block, problem, here, said, rows)


def _covering(block: Reconstruction) -> Index:
    """Rows of the points that take part: of each cell of each picture those seen by most."""
    count = np.diff(block.track_starts)
    point = block.point_of_sighting
    width = np.array([(c.width, c.height) for c in block.cameras])[block.observer]
    cell = np.clip((CELLS * block.xy_px / width).astype(int), 0, CELLS - 1)
    key = (block.observer * CELLS + cell[:, 1]) * CELLS + cell[:, 0]
    order = np.lexsort((block.error_px[point], -count[point], key))
    ranked = key[order]
    place = np.arange(len(order)) - np.searchsorted(ranked, ranked)
    return np.unique(point[order[place < IN_A_CELL]])


def _tracks(block: Reconstruction, chosen: Index, cameras: Cameras, points: Doubles) -> Tracks:
    number = np.full(len(block.points), -1, np.intp)
    number[chosen] = np.arange(len(chosen))
    rows = number[block.point_of_sighting] >= 0
    tracks = Tracks(
        block.observer[rows].astype(np.intp), number[block.point_of_sighting[rows]],
        block.xy_px[rows].astype(np.float64), np.ones(int(rows.sum())),
    )  # fmt: skip
    off = np.linalg.norm(track_residuals(tracks, cameras, points), axis=1)
    sigma = max(float(np.nanmedian(off)) / np.sqrt(MEDIAN_SQUARE), LEAST_TRACK_PX)
    return replace(tracks, sigma_px=np.full(len(off), sigma))


def _lenses(
    block: Reconstruction, cameras: Sequence[Camera], calibrated: Collection[str]
) -> LensParameters:
    """Focal length and distortion of each lens, principal point of each lens and format."""
    formats = [(w, c.width, c.height) for w, c in zip(block.lenses, cameras, strict=True)]
    given = np.array([name in calibrated for name in block.names])
    return LensParameters((
        _shared(("focal", "k1"), [*block.lenses], cameras, given),
        _shared(("cx", "cy"), formats, cameras, given),
    ))  # fmt: skip


def _shared(
    names: tuple[str, ...], keys: Sequence[object], cameras: Sequence[Camera], given: Bools
) -> SharedIntrinsics:
    order = list(dict.fromkeys(keys))
    group = np.array([order.index(key) for key in keys], np.intp)
    first = [int(np.flatnonzero(group == g)[0]) for g in range(len(order))]
    lens = [cameras[k].intrinsics for k in first]
    sigma = {"focal": FOCAL_SIGMA, "k1": RADIAL_SIGMA}
    return SharedIntrinsics(
        names, group,
        np.array([[intrinsic_value(k, name) for name in names] for k in lens]),
        np.array([[sigma.get(n, CENTER_SIGMA * k.width) for n in names] for k in lens]),
        np.array([[n == "focal" or not given[k] for n in names] for k in first]),
    )  # fmt: skip


def _planes(
    block: Reconstruction, chosen: Index, here: Adjusted, samples: ScanSamples,
    reach: float, least: float,
) -> Planes | None:  # fmt: skip
    """Each point with the plane of the nearest sample, if that faces a camera that saw it."""
    to_unit = samples.world_from_unit.inverse
    distance, nearest = samples.tree.query(
        to_unit.apply(here.points), distance_upper_bound=reach / samples.world_from_unit.scale
    )
    met = np.isfinite(distance)
    nearest = np.where(met, nearest, 0)
    normal = samples.normal[nearest].astype(np.float64)
    centers = np.array([camera.center for camera in here.cameras])
    toward = centers[block.observer[block.track_starts[chosen]]] - here.points
    met &= samples.partner[nearest] & (np.einsum("ni,ni->n", toward, normal) > 0)
    point = np.flatnonzero(met)
    if len(point) < LEAST_ON_SURFACE:
        return None
    on_plane = samples.world_from_unit.apply(samples.xyz[nearest[point]])
    off = np.abs(np.einsum("ni,ni->n", here.points[point] - on_plane, normal[point]))
    sigma = max(1.4826 * float(np.median(off)), least) * np.sqrt(PLANES_SHARE)
    return Planes(point, on_plane, normal[point], np.full(len(point), sigma))


def _known(said: Sequence[Said], rows: Sequence[int], trust: Doubles) -> KnownPoints:
    count = [len(one.px) for one in said]
    each = [t * one.counts / max(n, 1) for t, one, n in zip(trust, said, count, strict=True)]
    return KnownPoints(
        np.repeat(np.array(rows, np.intp), count),
        np.concatenate([np.zeros((0, 3)), *(one.xyz for one in said)]),
        np.concatenate([np.zeros((0, 2)), *(one.px for one in said)]),
        np.repeat([one.sigma_px for one in said], count),
        np.repeat(each, count),
    )


def _squares(said: Sequence[Said], rows: Sequence[int], cameras: Cameras) -> Doubles:
    """(said,) how far off what is said of each photo is, squared, one where it is as sure as it
    says.
    """
    out = np.zeros(len(said))
    for k, (one, row) in enumerate(zip(said, rows, strict=True)):
        gap = np.linalg.norm(cameras[row].project(one.xyz)[0] - one.px, axis=1) / one.sigma_px
        out[k] = np.nanmedian(gap**2) / MEDIAN_SQUARE if np.isfinite(gap).any() else np.inf
    return out


def _trust(said: Sequence[Said], rows: Sequence[int], cameras: Cameras) -> Doubles:
    trust: Doubles = 1 / (1 + _squares(said, rows, cameras) / DOUBT**2) ** 2
    return trust


def _concluded(
    block: Reconstruction, problem: Bundle, here: Adjusted, said: Sequence[Said],
    rows: Sequence[int],
) -> Bundled:  # fmt: skip
    squares = _squares(said, rows, here.cameras)
    apart = np.sqrt(squares * MEDIAN_SQUARE) * [one.sigma_px for one in said]
    width = np.array([here.cameras[row].width for row in rows])
    wrong = (squares > APART**2) & (apart > LEAST_APART * width)
    shares = np.repeat([one.share for one in said], [len(one.px) for one in said])
    looser = replace(
        problem,
        tracks=replace(problem.tracks, sigma_px=problem.tracks.sigma_px * np.sqrt(TRACKS_SHARE)),
        known=replace(problem.known, sigma_px=problem.known.sigma_px * shares),
    )
    covariance = adjust(looser, here.cameras, here.points, 0).covariance()
    return Bundled(
        here.cameras,
        _errors_px(problem, here, covariance),
        wrong,
        apart,
        len(problem.planes.point) / max(len(here.points), 1),
    )


def _errors_px(problem: Bundle, here: Adjusted, covariance: Doubles) -> Doubles:
    """(p,) root mean square motion of what each photo shows, pixels."""
    lenses, tracks = problem.lenses, problem.tracks
    errors = np.full(len(here.cameras), np.inf)
    for k, camera in enumerate(here.cameras):
        xyz = here.points[tracks.point[tracks.camera == k]]
        columns = np.concatenate([6 * k + np.arange(6), 6 * len(here.cameras) + lenses.columns[k]])
        free = np.concatenate([np.ones(6), lenses.free[lenses.columns[k]]])
        jacobian = projection_jacobian(camera, xyz, lenses.names) * free
        own = covariance[np.ix_(columns, columns)]
        own = np.where(np.outer(free, free) > 0, own, 0.0)
        if len(xyz):
            variance = displacement_variance(jacobian, own).mean()
            errors[k] = np.hypot(np.sqrt(variance), BLOCK_ERROR * camera.width)
    return errors

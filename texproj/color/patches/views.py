"""Which photos show each face, how well, and how far each is from what all of them show there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.camera import Camera
from texproj.color.balance.corrections import Gains, corrected, grids_of
from texproj.color.balance.photometry import Photometry
from texproj.color.points.source import CHUNK, Chunk, Owners
from texproj.color.sampling.store import SampleStore, Stack
from texproj.color.weights.surface import facing, resolution
from texproj.mesh import Mesh, face_areas
from texproj.options import ColorOptions, PatchOptions
from texproj.resources.threads import in_parallel

BARYCENTRIC = np.array([[1, 1, 1], [8, 1, 1], [1, 8, 1], [1, 1, 8]], np.float32)
BARYCENTRIC /= BARYCENTRIC.sum(axis=1, keepdims=True)
"""Where a face is looked at: in the middle and close to its corners, but surely on it."""

SAMPLES = len(BARYCENTRIC)

FEW = 16
"""Photos up to which a chunk holds `points.CHUNK` points."""

CANDIDATES = 10
"""Most photos that a face can choose from."""

MARGIN = 0.3
"""What it costs to use the very border of a photo, or the edge of something in front; 1 = as much
as a wrong photo."""

CONSENSUS_SCALE = 0.03
"""Difference from what all photos agree on (square root of linear light, 1 = white) that costs
half as much as a wrong photo."""

OUTLIER = 3.0
"""Beyond so many times that difference a photo is not used, if at least `FEWEST` others agree."""
FEWEST_FACES = 512

ROUNDS = 4
"""Rounds of the robust mean; it starts at the median."""

FEWEST = 3
"""Photos that must agree before another one can be called an outlier."""


@dataclass(frozen=True, eq=False)
class FacePoints:
    """`SAMPLES` points of each face; a chunk holds the first point of its `per_chunk` faces, then
    the second of each, and so on. Each point stands for its part of the face.
    """

    owners: Owners
    corners: Floats
    per_chunk: int

    @classmethod
    def of(cls, mesh: Mesh, photos: int) -> FacePoints:
        """All faces of the mesh; the more photos there are, the fewer in a chunk."""
        corners = (mesh.vertices - mesh.center)[mesh.faces].astype(np.float32)
        owners = Owners.of_faces(mesh, np.sqrt(face_areas(mesh) / SAMPLES))
        return cls(owners, corners, max(CHUNK // SAMPLES * FEW // max(photos, FEW), FEWEST_FACES))

    @property
    def sizes(self) -> list[int]:
        count = len(self.corners)
        step = self.per_chunk
        return [SAMPLES * min(step, count - start) for start in range(0, count, step)]

    def faces(self, number: int) -> slice:
        """The faces of a chunk."""
        start = number * self.per_chunk
        return slice(start, min(start + self.per_chunk, len(self.corners)))

    def chunk(self, number: int) -> Chunk:
        faces = self.faces(number)
        xyz = np.einsum("sk,fkc->sfc", BARYCENTRIC, self.corners[faces]).reshape(-1, 3)
        owner = np.tile(np.arange(faces.start, faces.stop, dtype=np.int32), SAMPLES)
        return Chunk(xyz, owner)


@dataclass(frozen=True, eq=False)
class FaceViews:
    """The photos that may color each face, best first.

    photo: (F, k) int32, -1 = none; cost: (F, k) float32, 0 = perfect, inf where none;
    to_consensus: (F, k, 3) float16 square root of linear light after gains, what all photos agree
    on minus this photo, 0 where none; density: (F,) float32 pixels per mesh unit of the best
    photo, 0 = unseen; partly: (F, k) int32 photos that show a part of a face that none shows as a
    whole, best first, -1 = none; outlier: (F, k) int32 photos that show something else there.
    """

    photo: NDArray[np.int32]
    cost: Floats
    to_consensus: NDArray[np.float16]
    density: Floats
    partly: NDArray[np.int32]
    outlier: NDArray[np.int32]

    @property
    def seen(self) -> NDArray[np.bool_]:
        """(F,) faces that some photo shows as a whole."""
        return self.photo[:, 0] >= 0


def sampling_options(options: ColorOptions) -> ColorOptions:
    """Samples of faces are weighted by the picture alone; angle and density come later, focus and
    bands of detail do not matter for patches.
    """
    return replace(options, angle_power=0.0, density_power=0.0, focus_power=0.0, blend="robust")


def face_views(
    points: FacePoints,
    cameras: Sequence[Camera],
    store: SampleStore,
    light: Photometry,
    options: ColorOptions,
    patch: PatchOptions,
) -> FaceViews:
    """The photos for each face from the samples of all of them."""
    count, k = len(points.corners), max(1, min(CANDIDATES, len(cameras)))
    out = FaceViews(
        np.full((count, k), -1, np.int32),
        np.full((count, k), np.inf, np.float32),
        np.zeros((count, k, 3), np.float16),
        np.zeros(count, np.float32),
        np.full((count, k), -1, np.int32),
        np.full((count, k), -1, np.int32),
    )
    gains, grids = light.gains, grids_of(cameras, light.corrections)

    def one(number: int) -> None:
        stack = corrected(store.read(number), points, number, grids)
        if len(stack.photos):
            rows = points.faces(number)
            quality, pixels = _quality(points, rows, [cameras[p] for p in stack.photos])
            cost, offset, outlier = _judged(stack, quality, gains, options, patch)
            _keep_best(out, rows, stack, cost, offset)
            shown = (stack.weight > 0).reshape(len(cost), SAMPLES, -1).mean(axis=1)
            _keep_photos(out.partly[rows], stack, shown * quality * (out.photo[rows, 0] < 0))
            _keep_photos(out.outlier[rows], stack, outlier.astype(np.float32))
            out.density[rows] = np.where(shown > 0, pixels, 0).max(axis=0)

    in_parallel(one, range(len(store.sizes)))
    return out


def _quality(points: FacePoints, rows: slice, cameras: list[Camera]) -> tuple[Floats, Floats]:
    """(p, n) pixels per square mesh unit of surface, as the photo shows it, and (p, n) pixels per
    mesh unit along the line that it shows frontally.
    """
    owners = Owners(
        points.owners.origin,
        points.owners.center[rows],
        points.owners.normal[rows],
        np.ones(rows.stop - rows.start, np.float32),
    )
    pixels = np.stack([resolution(owners, camera) for camera in cameras])
    cosine = np.stack([np.maximum(facing(owners, camera), 0) for camera in cameras])
    return pixels * pixels * cosine, pixels * np.sqrt(cosine)


def _judged(
    stack: Stack, quality: Floats, gains: Gains, options: ColorOptions, patch: PatchOptions
) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """(p, n) cost, inf where the photo does not show the whole face or shows something else,
    (p, 3, n) the way from the photo's color to the consensus, and (p, n) what shows something else.
    """
    p, n = quality.shape
    trust = stack.weight.reshape(p, SAMPLES, n)
    visible = trust > 0
    whole = visible.all(axis=1)
    trust = trust.mean(axis=1)
    share = quality / np.maximum(quality.max(axis=0), np.float32(1e-20))
    color = np.sqrt(stack.rgb * gains.factor[stack.photos][:, :, None])
    consensus = _consensus(color, stack.weight * np.tile(share, SAMPLES), options.robust_scale)
    away = (consensus - color).reshape(p, 3, SAMPLES, n) * visible[:, None]
    error = np.sqrt((away * away).mean(axis=1).sum(axis=1) / np.maximum(visible.sum(axis=1), 1))
    best = np.where(whole, quality, 0).max(axis=0)
    coarser = np.log2(np.maximum(best, 1e-20) / np.maximum(quality, 1e-20)).clip(0, 10)
    squared = (error / np.float32(CONSENSUS_SCALE)) ** 2
    cost = squared / (1 + squared) + np.float32(patch.resolution) * coarser
    cost += np.float32(MARGIN) * (1 - trust)
    outlier = error > np.float32(OUTLIER * CONSENSUS_SCALE)
    agreeing = np.count_nonzero(whole & ~outlier, axis=0)
    outlier &= agreeing >= FEWEST
    return np.where(whole & ~outlier, cost, np.float32(np.inf)), away.mean(axis=2), outlier


def _consensus(color: Floats, weight: Floats, scale: float) -> Floats:
    """(3, m) robust mean of the colors (p, 3, m) of all photos; weight: (p, m).

    Iteratively reweighted least squares, Cauchy loss, from the median of the channels on.
    """
    unseen = np.broadcast_to((weight == 0)[:, None], color.shape)
    center = np.nan_to_num(_nan_median(np.where(unseen, np.float32(np.nan), color)))
    for _ in range(ROUNDS):
        error = ((color - center) ** 2).sum(axis=1) * np.float32(scale**-2)
        trust = weight / (1 + error)
        norm = np.maximum(trust.sum(axis=0), np.float32(1e-20))
        center = np.einsum("pm,pcm->cm", trust, color) / norm
    return center


def _nan_median(values: Floats) -> Floats:
    """Median over the first axis of what is not NaN; NaN where all is."""
    count = np.count_nonzero(~np.isnan(values), axis=0)
    ordered = np.sort(values, axis=0)
    low = np.take_along_axis(ordered, np.maximum(count - 1, 0)[None] // 2, axis=0)[0]
    high = np.take_along_axis(ordered, count[None] // 2 % len(values), axis=0)[0]
    return np.where(count > 0, 0.5 * (low + high), np.float32(np.nan)).astype(np.float32)


def _keep_best(out: FaceViews, rows: slice, stack: Stack, cost: Floats, offset: Floats) -> None:
    """Write the cheapest photos of each face into its rows."""
    order = np.argsort(cost, axis=0, kind="stable")[: out.photo.shape[1]]
    kept = len(order)
    chosen = np.take_along_axis(cost, order, axis=0)
    usable = np.isfinite(chosen)
    out.photo[rows, :kept] = np.where(usable, stack.photos[order], -1).T
    out.cost[rows, :kept] = chosen.T
    way = np.take_along_axis(offset, order[:, None], axis=0)
    out.to_consensus[rows, :kept] = np.where(usable[:, None], way, 0).transpose(2, 0, 1)


def _keep_photos(out: NDArray[np.int32], stack: Stack, rank: Floats) -> None:
    """Write the photos of highest `rank` (p, n) above zero into the rows of `out` (n, k)."""
    order = np.argsort(-rank, axis=0, kind="stable")[: out.shape[1]]
    some = np.take_along_axis(rank, order, axis=0) > 0
    out[:, : len(order)] = np.where(some, stack.photos[order], -1).T

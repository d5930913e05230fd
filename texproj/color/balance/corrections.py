"""What is wrong with each photo as a whole, found from all of them, and put right in the samples
just before they are blended.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.camera import Camera
from texproj.color.points.source import Chunk, PointSource
from texproj.color.sampling.pixel_lookup import depth_pixels
from texproj.color.sampling.store import Stack
from texproj.opencv import opencv_places
from texproj.render import pinhole_cover


@dataclass(frozen=True, eq=False)
class Gains:
    """Factors on linear light that make the photos agree.

    factor: (p, 3) float32 per photo and channel, with the light of corrected lenses 1 in the
    geometric mean over what the photos show; spread: (p,) median absolute log difference to the
    others after correction; points: (p,) points that the photo shares with another one, of those
    that were compared.
    """

    factor: Floats
    spread: Floats
    points: NDArray[np.int64]


def no_gains(photos: int) -> Gains:
    """Every photo as it is."""
    return Gains(
        np.ones((photos, 3), np.float32), np.zeros(photos, np.float32), np.zeros(photos, np.int64)
    )


def _ones() -> Floats:
    return np.ones(3, np.float32)


@dataclass(frozen=True, eq=False)
class Correction:
    """What one photo needs.

    gain: (3,) float32 factor on linear light; light: factor on linear light over the picture,
    against vignetting, and trust: factor on the weights over the picture, each an (h, w) float32
    image of any small size that covers the photo, or None for 1 everywhere.
    """

    gain: Floats = field(default_factory=_ones)
    light: Floats | None = None
    trust: Floats | None = None


@dataclass(frozen=True, eq=False)
class Grid:
    """The images of a correction, ready to be looked up.

    camera: pinhole of the photo's pose; factors: (h, w, 2) float32 light and trust, in its pixels.
    """

    camera: Camera
    factors: Floats


def gains_of(corrections: Sequence[Correction]) -> Floats:
    """(p, 3) gains of all photos."""
    return np.array([c.gain for c in corrections], np.float32).reshape(-1, 3)


def grids_of(
    cameras: Sequence[Camera], corrections: Sequence[Correction]
) -> tuple[Grid | None, ...]:
    """One per photo, None for a photo that needs no more than its gain."""
    return tuple(grid_of(*both) for both in zip(cameras, corrections, strict=True))


def grid_of(camera: Camera, correction: Correction) -> Grid | None:
    """The images of a correction, taken through the lens. camera: of any size."""
    images = [image for image in (correction.light, correction.trust) if image is not None]
    if not images:
        return None
    height, width = np.max([image.shape for image in images], axis=0)
    ones = np.ones((1, 1), np.float32)
    factors = np.dstack([
        cv2.resize(ones if image is None else image, (width, height))
        for image in (correction.light, correction.trust)
    ])  # fmt: skip
    return _straightened(camera.resized(width, height), factors)


def _straightened(bent: Camera, factors: Floats) -> Grid:
    """The factors as a pinhole camera would see them."""
    straight = pinhole_cover(bent)
    if straight is bent:
        return Grid(bent, factors)
    b, k = bent.intrinsics, straight.intrinsics
    x, y = np.meshgrid(np.arange(k.width) + 0.5, np.arange(k.height) + 0.5)
    ideal = np.stack([(x - k.cx) / k.fx, (y - k.cy) / k.fy], axis=-1).reshape(-1, 2)
    at = b.distort(ideal) * (b.fx, b.fy) + (b.cx, b.cy)
    maps = opencv_places(at).reshape(k.height, k.width, 2)
    values = cv2.remap(factors, maps, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return Grid(straight, values)


def corrected(
    stack: Stack,
    points: PointSource,
    number: int,
    grids: Sequence[Grid | None],
    rows: slice = slice(None),
) -> Stack:
    """The samples of some rows of chunk `number` with the grids of their photos applied; gains are
    left to the blending. Photos without a grid cost nothing.
    """
    chosen = [(row, grids[photo]) for row, photo in enumerate(stack.photos)]
    if not any(grid for _, grid in chosen):
        return stack
    chunk, origin = points.chunk(number).part(rows), points.owners.origin
    out = replace(
        stack, rgb=stack.rgb.copy(), weight=stack.weight.copy(), trust=np.ones_like(stack.weight)
    )
    assert out.trust is not None
    for row, grid in chosen:
        if grid is not None:
            light, trust = factors_at(chunk, origin, grid).T
            out.rgb[row] *= light
            out.weight[row] *= trust
            out.trust[row] = trust
    return out if out.trust.min() < 1 else replace(out, trust=None)


def factors_at(chunk: Chunk, origin: NDArray[np.float64], grid: Grid) -> Floats:
    """(n, 2) light and trust at the points of a chunk (relative to `origin`), bilinear, held
    constant outside of the picture.
    """
    xy, _ = depth_pixels(chunk.xyz, origin, grid.camera)
    values = cv2.remap(grid.factors, xy, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return values.reshape(-1, 2)[: len(chunk)]

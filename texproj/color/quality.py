"""Numbers that say how sure the colors are, for the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.color.balance.focus import Focus
from texproj.color.balance.photometry import Photometry


def coverage(counts: list[NDArray[Any]], points: int) -> dict[str, Any]:
    """From the number of photos per point, in parts, and the number of points on the surface.

    seen: part of the points that a photo sees; seen_by_one: part of the seen points that only one
    photo sees, so that nothing there can be checked; photos_per_point: mean over the seen.
    """
    seen = sum(int(np.count_nonzero(count)) for count in counts)
    once = sum(int(np.count_nonzero(count == 1)) for count in counts)
    total = sum(int(count.sum(dtype=np.int64)) for count in counts)
    return {
        "points": points,
        "seen": seen / max(points, 1),
        "seen_by_one": once / max(seen, 1),
        "photos_per_point": total / max(seen, 1),
    }


def per_photo(
    names: Sequence[str],
    light: Photometry,
    focus: Sequence[Focus],
    share: NDArray[np.float64],
    failed: Mapping[str, str],
) -> list[dict[str, Any]]:
    """One entry per photo that was used.

    file: its name; gain: factor on each channel of linear light; disagreement: median absolute log
    difference to the other photos after correction; sharpness: contrast of fine detail against the
    other photos', 1 = as sharp as they, None = unknown; exposure_off: stops by which the photo is
    darker than its EXIF says, against the others, None = unknown; share: part of the surface's
    color that comes from it.
    """
    part, gains = share / max(float(share.sum()), 1e-12), light.gains
    return [
        {
            "file": name,
            "gain": [float(g) for g in gain],
            "disagreement": float(spread),
            "sharpness": None if sharp.lack is None else float(np.exp(sharp.lack / 2)),
            "exposure_off": float(off) if np.isfinite(off) else None,
            "share": float(used),
        }
        for name, gain, spread, off, sharp, used in zip(
            names, gains.factor, gains.spread, light.exposure_off, focus, part, strict=True
        )
        if name not in failed
    ]


def per_lens(names: Sequence[str], light: Photometry) -> list[dict[str, Any]]:
    """One entry per lens that at least three photos share.

    photos: their names; light_at_corners: factor on the light at radius `reach` (half diagonals),
    the furthest that is seen on shared surface; sigma: standard deviation of its logarithm;
    disagreement_left: part of the photos' disagreement that is left when it is corrected;
    corrected: whether it was.
    """
    return [
        {
            "photos": [names[photo] for photo in lens.photos],
            "light_at_corners": lens.corner,
            "reach": lens.reach,
            "sigma": lens.sigma,
            "disagreement_left": lens.left,
            "corrected": lens.corrected,
        }
        for lens in light.lenses
    ]

"""Which pixels of a photo show the object."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats, Mask
from texproj.errors import RegistrationError
from texproj.photo import Photo

LONGEST = 384
"""Longer side, pixels, at which photos are segmented."""
STRIP = 0.04
"""Width of the strip along the border that is taken for background, of the longer side."""
FAR = 4.0
"""Deviation from the background, in its own scatter, from which on a pixel is the object."""
LEAST_SCATTER = 1.5
"""Scatter, 8-bit levels, below which a background is not believed to be."""
UNIFORM = 9.0
"""Scatter, 8-bit levels, above which a background is not uniform."""
SHARE = (0.01, 0.95)
"""Part of the picture that an object may fill."""
SURE = 0.04
"""Distance from the projected outline beyond which a start is trusted, of the longer side."""


def object_mask(photo: Photo, rough: Mask | None = None) -> Mask:
    """(h, w) bool: the photo's own mask if it has one, else found in the picture.

    rough: (any size) the object's projection from a rough camera, from which the picture is
    segmented where the background is not uniform. Raises RegistrationError if nothing is found.
    """
    if photo.mask is not None and (photo.mask == 0).any():
        return photo.mask > 0
    small = photo.reduced(LONGEST).srgb8()
    found = uniform_background(small)
    if found is None and rough is not None:
        found = segmented_around(small, rough)
    if found is None or not SHARE[0] < found.mean() < SHARE[1]:
        raise RegistrationError(
            f"{photo.info.name}: the object cannot be told from what is around it "
            "(give a mask of it, or pick 8 points)"
        )
    size = (photo.width, photo.height)
    return cv2.resize(found.astype(np.float32), size, interpolation=cv2.INTER_LINEAR) > 0.5


def uniform_background(picture: NDArray[np.uint8]) -> Mask | None:
    """What stands before a smooth background in an (h, w, 3) picture; None if there is none.

    The background is a quadratic in x and y per channel, fitted robustly to the border.
    """
    lab = cv2.GaussianBlur(cv2.cvtColor(picture, cv2.COLOR_RGB2LAB), (0, 0), 1).astype(np.float32)
    height, width = lab.shape[:2]
    strip = np.ones((height, width), bool)
    edge = max(2, round(STRIP * max(height, width)))
    strip[edge:-edge, edge:-edge] = False
    y, x = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    basis = np.stack([np.ones_like(x), x, y, x * y, x * x, y * y], axis=2)
    background, scatter = _fitted(basis[strip], lab[strip])
    if scatter > UNIFORM:
        return None
    distance = np.linalg.norm(lab - basis @ background, axis=2) / max(scatter, LEAST_SCATTER)
    return _solid_part(distance > FAR)


def _fitted(basis: NDArray[np.float64], values: Floats) -> tuple[NDArray[np.float64], float]:
    """Coefficients of the majority of the values, and their scatter."""
    kept = np.ones(len(values), bool)
    coefficients: NDArray[np.float64] = np.zeros((basis.shape[1], values.shape[1]))
    scatter = np.inf
    for _ in range(8):
        coefficients = np.linalg.lstsq(basis[kept], values[kept].astype(float), rcond=None)[0]
        gap = np.linalg.norm(values - basis @ coefficients, axis=1)
        scatter = float(np.percentile(gap, 60))
        kept = gap < max(2.5 * scatter, LEAST_SCATTER)
    return coefficients, scatter


def segmented_around(picture: NDArray[np.uint8], rough: Mask) -> Mask:
    """The object of an (h, w, 3) picture whose outline is near that of `rough` (any size).

    GrabCut (Rother, Kolmogorov and Blake, SIGGRAPH 2004) between what is surely in and out.
    """
    height, width = picture.shape[:2]
    start = cv2.resize(rough.astype(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST)
    reach = 2 * max(1, round(SURE * max(width, height))) + 1
    kernel = np.ones((reach, reach), np.uint8)
    labels = np.where(start > 0, cv2.GC_PR_FGD, cv2.GC_PR_BGD).astype(np.uint8)
    labels[cv2.dilate(start, kernel) == 0] = cv2.GC_BGD
    labels[cv2.erode(start, kernel) > 0] = cv2.GC_FGD
    if not {cv2.GC_BGD, cv2.GC_FGD} <= set(np.unique(labels).tolist()):
        return start > 0
    bgr = np.ascontiguousarray(picture[..., ::-1])
    cv2.grabCut(bgr, labels, None, np.zeros((1, 65)), np.zeros((1, 65)), 4, cv2.GC_INIT_WITH_MASK)
    return _solid_part((labels == cv2.GC_FGD) | (labels == cv2.GC_PR_FGD))


def _solid_part(mask: Mask) -> Mask:
    """The largest connected part, without specks and thin bridges."""
    kernel = np.ones((3, 3), np.uint8)
    clean = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, kernel)
    clean = cv2.morphologyEx(clean, cv2.MORPH_CLOSE, kernel)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(clean)
    if len(stats) < 2:
        return clean > 0
    largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    return labels == largest

"""Local features of photos: where they are, and which of two photos are the same."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

MOST_FEATURES = 4000
RATIO = 0.8
"""Best distance over second best at which a match is unique enough (Lowe, "Distinctive image
features from scale-invariant keypoints", IJCV 2004, section 7.1)."""
CONTRAST = 0.02
"""Half of OpenCV's threshold: stone has little contrast."""


@dataclass(frozen=True, eq=False)
class Features:
    """Local features of a photo.

    xy_px: (n, 2) float64 continuous pixels; descriptors: (n, 128) float32, RootSIFT.
    """

    xy_px: NDArray[np.float64]
    descriptors: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.xy_px)


def find_features(gray: NDArray[np.float32], valid: NDArray[np.bool_] | None = None) -> Features:
    """The strongest features of (h, w) luma in 0..1, where `valid`.

    RootSIFT: Arandjelovic and Zisserman, "Three things everyone should know to improve object
    retrieval", CVPR 2012.
    """
    image = np.round(gray.clip(0, 1) * 255).astype(np.uint8)
    mask = None if valid is None else valid.astype(np.uint8)
    sift = cv2.SIFT.create(
        nfeatures=MOST_FEATURES, contrastThreshold=CONTRAST, enable_precise_upscale=True
    )
    points, descriptors = sift.detectAndCompute(image, mask)
    if descriptors is None:
        return Features(np.zeros((0, 2)), np.zeros((0, 128), np.float32))
    total = descriptors.sum(axis=1, keepdims=True)
    xy = np.array([point.pt for point in points], np.float64) + 0.5
    return Features(xy, np.sqrt(descriptors / np.maximum(total, 1e-9)))


def match_features(a: Features, b: Features) -> NDArray[np.intp]:
    """(m, 2) numbers of features of a and b that are each other's nearest, and clearly so."""
    if len(a) < 2 or len(b) < 2:
        return np.zeros((0, 2), np.intp)
    matcher = cv2.BFMatcher(cv2.NORM_L2)
    forth = matcher.knnMatch(a.descriptors, b.descriptors, k=2)
    back = {m.queryIdx: m.trainIdx for m in matcher.match(b.descriptors, a.descriptors)}
    pairs = [
        (best.queryIdx, best.trainIdx)
        for best, second in forth
        if best.distance < RATIO * second.distance and back[best.trainIdx] == best.queryIdx
    ]
    return np.array(pairs, np.intp).reshape(-1, 2)

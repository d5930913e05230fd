"""Pictures as JPEG, in memory."""

from __future__ import annotations

import cv2

from texproj.arrays import Bytes
from texproj.errors import OutputError

SAMPLING = (cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444)
"""Color as fine as light: thin colored lines and the borders of charts stay sharp."""


def jpeg_bytes(rgb: Bytes, quality: int) -> bytes:
    """A (h, w, 3) uint8 sRGB picture as a JPEG file's content. quality: 1..100.

    Raises OutputError for a picture that is larger than JPEG holds.
    """
    bgr = cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR)
    done, encoded = cv2.imencode(".jpg", bgr, (cv2.IMWRITE_JPEG_QUALITY, quality, *SAMPLING))
    if not done:
        raise OutputError(f"a picture of {rgb.shape[1]} x {rgb.shape[0]} pixels is no jpeg")
    return encoded.tobytes()

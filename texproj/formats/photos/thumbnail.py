"""Small pictures of photos for lists: of a RAW file the one that its camera put in."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from texproj.formats.documents import read_bytes
from texproj.formats.foreign import Broken, foreign_parser
from texproj.formats.photos.raw import raw_preview
from texproj.photo import Photo, PhotoInfo

SAME_SHAPE = 0.03
"""By how much the preview's shape may differ: some cameras leave black borders, these are cut."""
CLOCKWISE = {
    3: cv2.ROTATE_180, 6: cv2.ROTATE_90_CLOCKWISE, 8: cv2.ROTATE_90_COUNTERCLOCKWISE,
}  # fmt: skip


def read_thumbnail(path: Path, info: PhotoInfo, longest: int) -> Photo | None:
    """The camera's own preview, upright, in its colors; None where it has none of the photo's
    shape and of `longest` pixels.
    """
    try:
        with foreign_parser():
            data = raw_preview(read_bytes(path))
            pixels = None if data is None else _decoded(data)
    except Broken:
        return None
    if pixels is None:
        return None
    turn = CLOCKWISE.get(info.orientation)
    upright = pixels if turn is None else cv2.rotate(pixels, turn)
    height, width = upright.shape[:2]
    if max(height, width) < longest:
        return None
    if abs(width * info.height / (height * info.width) - 1) > SAME_SHAPE:
        return None
    return Photo(info, np.ascontiguousarray(upright)).reduced(longest)


def _decoded(data: bytes) -> np.ndarray | None:
    flags = cv2.IMREAD_COLOR_RGB | cv2.IMREAD_IGNORE_ORIENTATION
    return cv2.imdecode(np.frombuffer(data, np.uint8), flags)

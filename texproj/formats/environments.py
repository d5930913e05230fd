"""Pictures of light from all directions: equirectangular, linear."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from texproj.arrays import Floats
from texproj.errors import InputError
from texproj.formats.documents import read_bytes
from texproj.formats.photos import read_photo, read_photo_info

RADIANCE = ".hdr"
LONGEST = 4096
"""Longer side that is kept, pixels: no picture shows more of its surroundings."""
SLACK = 2
"""Pixels of width that programs lose or add where they reduce pictures."""
MOST_BYTES = 1 << 30
HIGHEST = 1e12
"""Beyond, sums over a picture are no numbers any more."""


def read_environment(path: Path) -> Floats:
    """(h, 2 h, 3) float32 linear RGB: Radiance's .hdr, or whatever photos may be, OpenEXR among
    them.

    Raises InputError for a file that cannot be read, or is not twice as wide as high.
    """
    picture = _radiance(path) if path.suffix.lower() == RADIANCE else _photo(path)
    return np.ascontiguousarray(np.clip(np.nan_to_num(picture, nan=0.0), 0, HIGHEST), np.float32)


def _radiance(path: Path) -> Floats:
    """Radiance's RGBE, by OpenCV."""
    data = np.frombuffer(read_bytes(path, MOST_BYTES), np.uint8)
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # it is told below
    try:
        picture = cv2.imdecode(data, cv2.IMREAD_ANYDEPTH | cv2.IMREAD_COLOR)
    except cv2.error:
        picture = None
    finally:
        cv2.utils.logging.setLogLevel(level)
    if picture is None or picture.dtype != np.float32:
        raise InputError(f"{path}: damaged, or no Radiance picture; save it again")
    _check_shape(path, *picture.shape[:2])
    if max(picture.shape) > LONGEST:
        picture = cv2.resize(picture, (LONGEST, LONGEST // 2), interpolation=cv2.INTER_AREA)
    return cv2.cvtColor(picture, cv2.COLOR_BGR2RGB)


def _photo(path: Path) -> Floats:
    info = read_photo_info(path)
    _check_shape(path, info.height, info.width)
    return read_photo(path, info, longest=LONGEST).linear()


def _check_shape(path: Path, height: int, width: int) -> None:
    """Raise InputError for a file whose picture, before it is reduced, is of another shape."""
    if abs(width - 2 * height) > min(SLACK, height / 8):
        raise InputError(
            f"{path}: an environment shows all directions and is twice as wide as high, this one is"
            f" {width} x {height} pixels"
        )

"""Pictures as a camera stores them: JPEG with EXIF, held upright by its orientation tag."""

from __future__ import annotations

import io
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from PIL.ExifTags import IFD, Base
from PIL.TiffImagePlugin import IFDRational

from texproj.demo.views import Body

FILM_DIAGONAL_MM = float(np.hypot(36, 24))
STANDS_ON_RIGHT_SIDE = 6
"""EXIF orientation of a photo taken with the camera turned: shown after a turn clockwise."""
NORMAL_TIME_S = 1 / 16000
"""Exposure time at EV 0 for ISO 100 and f/1: 1/250 at f/8."""


@dataclass(frozen=True)
class Exif:
    """What the camera notes: body, exposure step, running number; turned: stored lying down."""

    body: Body
    ev: float
    number: int
    turned: bool


def focal_35mm(body: Body, width: int, height: int) -> int:
    """The focal length that gives the same picture diagonal on 36 x 24 mm film, whole mm."""
    focal_px = body.focal * max(width, height)
    return round(focal_px * FILM_DIAGONAL_MM / float(np.hypot(width, height)))


def focal_px_of_exif(body: Body, width: int, height: int) -> float:
    """Focal length in pixels as far as the rounded EXIF value tells it."""
    return focal_35mm(body, width, height) * float(np.hypot(width, height)) / FILM_DIAGONAL_MM


def jpeg(pixels: NDArray[np.uint8], exif: Exif, quality: int = 93) -> bytes:
    """The bytes of an upright (h, w, 3) sRGB picture."""
    height, width = pixels.shape[:2]
    image = Image.fromarray(np.rot90(pixels) if exif.turned else pixels)
    out = io.BytesIO()
    tags = _tags(exif, focal_35mm(exif.body, width, height))
    image.save(out, "JPEG", quality=quality, subsampling=0, exif=tags)
    return out.getvalue()


def _tags(exif: Exif, focal: int) -> Image.Exif:
    tags = Image.Exif()
    tags[Base.Make], tags[Base.Model] = "texproj", exif.body.name
    tags[Base.Orientation] = STANDS_ON_RIGHT_SIDE if exif.turned else 1
    tags[Base.DateTime] = f"2026:05:17 10:{exif.number:02d}:00"
    inner = tags.get_ifd(IFD.Exif)
    inner[Base.FocalLengthIn35mmFilm] = focal
    time_s = NORMAL_TIME_S * 2**exif.ev * exif.body.f_number**2 * 100 / exif.body.iso
    inner[Base.ExposureTime] = IFDRational(round(time_s * 1e6), 1000000)
    inner[Base.FNumber] = IFDRational(round(exif.body.f_number * 10), 10)
    inner[Base.ISOSpeedRatings] = exif.body.iso
    inner[Base.BodySerialNumber] = f"{sum(exif.body.name.encode())}"
    return tags

"""EXIF: how its blocks are read, and what they say of lens and exposure."""

from __future__ import annotations

import contextlib
import math
import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any, Protocol

from texproj.errors import excerpt
from texproj.formats.camera_bounds import FOCAL_OVER_SIDE
from texproj.formats.foreign import Broken, foreign_parser
from texproj.formats.photos.raster import Tags

DIAGONAL_35MM = math.hypot(36, 24)
MM_PER_UNIT = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}
"""EXIF ResolutionUnit and FocalPlaneResolutionUnit: inch, cm, mm, micrometre."""

LONGEST_BODY = 100
"""Characters of a camera's name."""
LONGEST_RIGHTS = 300
TAKEN = re.compile(r"(\d{4}):(\d\d):(\d\d) (\d\d):(\d\d):(\d\d)", re.ASCII)
EXPOSURE_BOUNDS = (1e-9, 1e9)
"""Seconds, f-numbers and ISO values that a camera could write."""

FOCAL_AGREEMENT = 0.1
"""A 35 mm equivalent is rounded to whole millimetres and to a nominal sensor: 10 % at worst."""

MAKE, MODEL, SERIAL = 271, 272, 0xA431
ARTIST, COPYRIGHT, DATETIME_ORIGINAL = 315, 33432, 0x9003
EXPOSURE_TIME, F_NUMBER, ISO = 0x829A, 0x829D, 0x8827
FOCAL_MM, FOCAL_35MM = 0x920A, 0xA405
PLANE_X_RESOLUTION, PLANE_UNIT = 0xA20E, 0xA210
PIXEL_WIDTH, PIXEL_HEIGHT = 0xA002, 0xA003
EXIF_IFD, INTEROP_IFD = 0x8769, 0xA005


class Described(Protocol):
    """A picture's size as stored, and its EXIF values."""

    @property
    def width(self) -> int: ...

    @property
    def height(self) -> int: ...

    @property
    def tags(self) -> Mapping[int, Any]: ...

    @property
    def exif(self) -> Mapping[int, Any]: ...


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """No warnings of Pillow's about odd tags: nobody can do anything about them."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module=r"PIL\.")
        yield


def read_or_none(load: Callable[[], tuple[Tags, Tags]]) -> tuple[Tags, Tags]:
    """Main and photo directory; what is broken in them is left out: they are a nicety only."""
    with quiet():
        try:
            with foreign_parser():
                return load()
        except Broken:
            return {}, {}


def directories_of(block: bytes) -> tuple[Tags, Tags]:
    """Main and photo directory of an EXIF block, with or without the mark before it."""
    from PIL import Image  # noqa: PLC0415

    exif = Image.Exif()
    exif.load(block)
    return dict(exif), {**exif.get_ifd(INTEROP_IFD), **exif.get_ifd(EXIF_IFD)}


def number_of(values: Mapping[int, Any], tag: int) -> float | None:
    """A positive finite EXIF number, None if absent, zero or broken."""
    value = values.get(tag)
    if isinstance(value, tuple | list):
        value = value[0] if value else None
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, ZeroDivisionError, OverflowError):
        return None
    return number if math.isfinite(number) and number > 0 else None


def focal_px_of(header: Described) -> tuple[float | None, tuple[str, ...]]:
    """Focal length in pixels, and what to mind about it.

    From the focal-plane resolution where it agrees with the 35 mm equivalent or stands alone,
    else from the 35 mm equivalent (over the diagonal).
    """
    width, height, note = _exposed_size(header)
    notes = (note,) if note else ()
    by_35mm = by_plane = None
    if film_mm := number_of(header.exif, FOCAL_35MM):
        by_35mm = film_mm / DIAGONAL_35MM * math.hypot(width, height)
    focal_mm, resolution = (
        number_of(header.exif, FOCAL_MM),
        number_of(header.exif, PLANE_X_RESOLUTION),
    )
    unit = MM_PER_UNIT.get(int(number_of(header.exif, PLANE_UNIT) or 2))
    if focal_mm and resolution and unit:
        recorded = number_of(header.exif, PIXEL_WIDTH) or header.width
        scale = width / recorded
        by_plane = focal_mm * resolution / unit * scale
    if by_plane and by_35mm and abs(by_plane / by_35mm - 1) > FOCAL_AGREEMENT:
        by_plane = None
        notes = (*notes, "the two focal lengths in EXIF disagree: the 35 mm one is used")
    low, high = (bound * max(header.width, header.height) for bound in FOCAL_OVER_SIDE)
    focal_px = by_plane or by_35mm
    if focal_px is None or not low <= focal_px <= high:
        notes = (*notes, "EXIF tells no focal length that could be turned into pixels")
        return None, notes
    return focal_px, notes


def _exposed_size(header: Described) -> tuple[float, float, str]:
    """Size in pixels of what the lens threw on the sensor: larger than a cropped picture."""
    width, height = number_of(header.exif, PIXEL_WIDTH), number_of(header.exif, PIXEL_HEIGHT)
    if not width or not height:
        return header.width, header.height, ""
    if (width < height) != (header.width < header.height):
        width, height = height, width
    if abs(width * header.height - height * header.width) <= 2 * max(width, header.width):
        return header.width, header.height, ""  # as taken, or reduced as a whole
    told = f"{width:.0f} x {height:.0f}"
    return width, height, f"EXIF speaks of {told} pixels: the photo was cropped or rotated"


def body_of(header: Described) -> str:
    """Maker, model and serial number, each once."""
    make, model, serial = (
        excerpt(str(values.get(tag) or "").strip(" \0"), LONGEST_BODY)
        for values, tag in ((header.tags, MAKE), (header.tags, MODEL), (header.exif, SERIAL))
    )
    if make and model.lower().startswith(make.lower()):
        make = ""
    return " ".join(part for part in (make, model, serial) if part)


def rights_of(header: Described) -> tuple[str, str]:
    """Copyright (photographer's and editor's, parted by a zero byte) and artist, one line each."""
    copyright_, artist = (
        " ".join(str(header.tags.get(tag) or "").replace("\0", " ").split())
        for tag in (COPYRIGHT, ARTIST)
    )
    return excerpt(copyright_, LONGEST_RIGHTS), excerpt(artist, LONGEST_RIGHTS)


def taken_of(header: Described) -> str:
    """When the photo was taken, ISO 8601 without a zone as EXIF has it; empty if not told."""
    found = TAKEN.fullmatch(str(header.exif.get(DATETIME_ORIGINAL) or "").strip(" \0"))
    return f"{'-'.join(found.groups()[:3])}T{':'.join(found.groups()[3:])}" if found else ""


def exposure_ev_of(header: Described) -> float | None:
    """log2(t ISO / (100 N^2)): the light that reaches the file, in stops."""
    of = partial(number_of, header.exif)
    time_s, f_number, iso = of(EXPOSURE_TIME), of(F_NUMBER), of(ISO)
    low, high = EXPOSURE_BOUNDS
    if not (time_s and f_number and iso) or not all(
        low <= value <= high for value in (time_s, f_number, iso)
    ):
        return None
    return math.log2(time_s * iso / 100 / f_number**2)

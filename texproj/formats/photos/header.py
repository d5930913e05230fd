"""What a photo file's header tells: size, orientation, lens, exposure, color profile."""

from __future__ import annotations

import contextlib
import io
import math
import struct
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from texproj.errors import InputError, excerpt
from texproj.formats.camera_bounds import FOCAL_OVER_SIDE
from texproj.formats.foreign import Broken, foreign_parser
from texproj.formats.photos.icc import adobe_rgb, usable
from texproj.formats.photos.tiff import MAGIC, Tags, directories, photo_page
from texproj.photo import LARGEST_PHOTO_MP, PhotoInfo

PHOTO_SUFFIXES = (".jpg", ".jpeg", ".png", ".tif", ".tiff")

DIAGONAL_35MM = math.hypot(36, 24)
MM_PER_UNIT = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}
"""EXIF ResolutionUnit and FocalPlaneResolutionUnit: inch, cm, mm, micrometre."""

LONGEST_SIDE_PX = 32_766
"""What OpenCV's remap can take from and give."""

MOST_EXIF_BYTES = 16 << 20
LONGEST_BODY = 100
"""Characters of a camera's name."""
EXPOSURE_BOUNDS = (1e-9, 1e9)
"""Seconds, f-numbers and ISO values that a camera could write."""

OTHER_IMAGES = {
    b"GIF8": "GIF", b"BM": "BMP", b"RIFF": "WebP", b"8BPS": "Photoshop", b"%PDF": "PDF",
    b"#?RADIANCE": "HDR", b"v/1\x01": "OpenEXR", b"\xff\x4f\xff\x51": "JPEG 2000",
    b"\0\0\0\x0cjP": "JPEG 2000",
}  # fmt: skip
"""Kinds of images by their first bytes, so that their name can be told."""

FOCAL_AGREEMENT = 0.1
"""A 35 mm equivalent is rounded to whole millimetres and to a nominal sensor: 10 % at worst."""

ORIENTATION, ICC_PROFILE, MAKE, MODEL = 274, 34675, 271, 272
EXIF_IFD, INTEROP_IFD = 0x8769, 0xA005
COLOR_SPACE, INTEROP_INDEX = 0xA001, 1


@dataclass(frozen=True)
class Header:
    """The header of a photo file, sizes as stored.

    kind: "JPEG", "PNG" or "TIFF"; channels: 1 gray, 3 RGB, 4 CMYK, alpha not counted;
    orientation: EXIF 1..8; profile: the ICC profile that fits or empty; tags, exif: EXIF values
    by number (main directory; photo and interoperability directories); notes: what was odd.
    """

    kind: str
    width: int
    height: int
    channels: int
    orientation: int
    profile: bytes
    tags: Mapping[int, Any]
    exif: Mapping[int, Any]
    notes: tuple[str, ...] = ()

    @property
    def turned(self) -> bool:
        """Whether width and height swap when the photo is made upright."""
        return self.orientation >= 5

    @property
    def upright_size(self) -> tuple[int, int]:
        size = (self.width, self.height)
        return size[::-1] if self.turned else size


def read_photo_info(path: Path, largest_mp: float = LARGEST_PHOTO_MP) -> PhotoInfo:
    """What the header of a jpg, png or tiff says; no pixel is decoded.

    Raises InputError for a file that is missing, empty, broken, no such image, or of more than
    `largest_mp` million pixels.
    """
    try:
        with path.open("rb") as file:
            header = header_of(path, file, largest_mp)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    width, height = header.upright_size
    focal_px, notes = _focal(header)
    if not header.exif:
        notes = ("no EXIF data: focal length and exposure are unknown",)
    return PhotoInfo(
        path.name, width, height, focal_px, _body(header), _exposure_ev(header),
        (*header.notes, *notes), header.orientation,
    )  # fmt: skip


def header_of(
    path: Path, file: io.BufferedIOBase, largest_mp: float, what: str = "photo"
) -> Header:
    """The header of an open image file; `path` and `what` (photo or mask) are only for messages.

    Raises InputError.
    """
    start = file.read(64)
    file.seek(0)
    if not start.strip(b"\0 \t\r\n"):
        raise InputError(f"{path}: the {what} is empty; copy it again")
    if start[:4] in MAGIC:
        header = _tiff_header(path, file, what)
    elif start[:3] == b"\xff\xd8\xff" or start[:4] == b"\x89PNG":
        header = _pillow_header(path, file, what)
    else:
        raise InputError(f"{path}: {_what_else(start)}")
    _check_size(path, header.width, header.height, largest_mp)
    return header


def _check_size(path: Path, width: int, height: int, largest_mp: float) -> None:
    if width * height > largest_mp * 1e6:
        raise InputError(
            f"{path}: {width} x {height} pixels are {width * height / 1e6:.0f} million, and"
            f" {largest_mp:g} are read at most; reduce the photo, or set largest_photo_mp"
        )
    if max(width, height) > LONGEST_SIDE_PX:
        raise InputError(
            f"{path}: {width} x {height} pixels, and sides of {LONGEST_SIDE_PX} are read at most;"
            " reduce the photo"
        )


def _what_else(start: bytes) -> str:
    """A sentence about a file that is no jpg, png or tiff."""
    kind = next((name for magic, name in OTHER_IMAGES.items() if start.startswith(magic)), None)
    if start[4:8] == b"ftyp":
        kind = "HEIC or AVIF"
    if kind:
        return f"a {kind} image; convert it to jpg, png or tiff"
    is_text = start.isascii() and b"\0" not in start
    return f"not a jpg, png or tiff photo but {'text' if is_text else 'an unknown format'}"


def _pillow_header(path: Path, file: io.BufferedIOBase, what: str) -> Header:
    from PIL import Image  # noqa: PLC0415

    Image.MAX_IMAGE_PIXELS = None  # `_check_size` has the limit
    try:
        with quiet(), foreign_parser():
            image = Image.open(file, formats=("JPEG", "PNG"))
    except Broken as error:
        raise InputError(f"{path}: the {what} is damaged ({error}); copy it again") from None
    kind = "PNG" if image.format == "PNG" else "JPEG"
    channels = {"C": 4, "L": 1, "1": 1, "I": 1}.get(image.mode[0], 3)
    profile = image.info.get("icc_profile")
    block = image.info.get("exif") or b"" if kind == "JPEG" else _png_exif(file)
    return _header(kind, (*image.size, channels), profile, *_exif(lambda: _directories(block)))


def _tiff_header(path: Path, file: io.BufferedIOBase, what: str) -> Header:
    try:
        with foreign_parser(), photo_page(file) as (page, first, note):
            size = (int(page.imagewidth), int(page.imagelength))
            channels = {0: 1, 1: 1, 5: 4}.get(int(page.photometric), 3)
            tags, photo = _exif(lambda: directories(page, first))
    except Broken as error:
        told = f"the {what} is a damaged TIFF file ({error}); copy it again"
        raise InputError(f"{path}: {told}") from None
    if min(size) < 1:
        raise InputError(f"{path}: the {what} is a damaged TIFF file without a size; copy it again")
    return _header("TIFF", (*size, channels), tags.get(ICC_PROFILE), tags, photo, note)


def _header(
    kind: str, shape: tuple[int, int, int], given: Any,
    tags: Mapping[int, Any], exif: Mapping[int, Any], note: str = "",
) -> Header:  # fmt: skip
    orientation = tags.get(ORIENTATION, 1)
    if orientation not in range(1, 9):
        orientation = 1
    profile = given if isinstance(given, bytes) else b"-" if given else b""
    if not profile and exif.get(COLOR_SPACE) == 0xFFFF and exif.get(INTEROP_INDEX) == "R03":
        profile = adobe_rgb()  # DCF 2.0: how cameras mark Adobe RGB without embedding a profile
    notes = (note,) if note else ()
    if profile and not usable(profile, shape[2]):
        broken = "its color profile is broken or of another kind: sRGB is assumed"
        profile, notes = b"", (*notes, broken)
    if shape[2] == 4 and not profile:
        notes = (*notes, "CMYK without a color profile: colors are a guess")
    return Header(kind, *shape, int(orientation), profile, tags, exif, notes)


def _exif(load: Callable[[], tuple[Tags, Tags]]) -> tuple[Tags, Tags]:
    """Main and photo directory; what is broken in them is left out: they are a nicety only."""
    with quiet():
        try:
            with foreign_parser():
                return load()
        except Broken:
            return {}, {}


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """No warnings of Pillow's about odd tags: nobody can do anything about them."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module=r"PIL\.")
        yield


def _directories(block: bytes) -> tuple[Tags, Tags]:
    from PIL import Image  # noqa: PLC0415

    exif = Image.Exif()
    exif.load(block)
    return dict(exif), {**exif.get_ifd(INTEROP_IFD), **exif.get_ifd(EXIF_IFD)}


def _png_exif(file: io.BufferedIOBase) -> bytes:
    """The EXIF block of a PNG, before or after its pixels, which Pillow would decode for it."""
    file.seek(8)
    while len(head := file.read(8)) == 8:
        length, kind = struct.unpack(">I4s", head)
        if kind == b"eXIf":
            return file.read(min(length, MOST_EXIF_BYTES))
        file.seek(length + 4, io.SEEK_CUR)
    return b""


def _number(values: Mapping[int, Any], tag: int) -> float | None:
    """A positive finite EXIF number, None if absent, zero or broken."""
    value = values.get(tag)
    if isinstance(value, tuple | list):
        value = value[0] if value else None
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, ZeroDivisionError, OverflowError):
        return None
    return number if math.isfinite(number) and number > 0 else None


def _focal(header: Header) -> tuple[float | None, tuple[str, ...]]:
    """Focal length in pixels, and what to mind about it.

    From the focal-plane resolution where it agrees with the 35 mm equivalent or stands alone,
    else from the 35 mm equivalent (over the diagonal).
    """
    width, height, note = _exposed_size(header)
    notes = (note,) if note else ()
    by_35mm = by_plane = None
    if film_mm := _number(header.exif, 0xA405):
        by_35mm = film_mm / DIAGONAL_35MM * math.hypot(width, height)
    focal_mm, resolution = _number(header.exif, 0x920A), _number(header.exif, 0xA20E)
    unit = MM_PER_UNIT.get(int(_number(header.exif, 0xA210) or 2))
    if focal_mm and resolution and unit:
        recorded = _number(header.exif, 0xA002) or header.width
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


def _exposed_size(header: Header) -> tuple[float, float, str]:
    """Size in pixels of what the lens threw on the sensor: larger than a cropped picture."""
    width, height = _number(header.exif, 0xA002), _number(header.exif, 0xA003)
    if not width or not height:
        return header.width, header.height, ""
    if (width < height) != (header.width < header.height):
        width, height = height, width
    if abs(width * header.height - height * header.width) <= 2 * max(width, header.width):
        return header.width, header.height, ""  # as taken, or reduced as a whole
    told = f"{width:.0f} x {height:.0f}"
    return width, height, f"EXIF speaks of {told} pixels: the photo was cropped or rotated"


def _body(header: Header) -> str:
    """Maker, model and serial number, each once."""
    make, model, serial = (
        excerpt(str(values.get(tag) or "").strip(" \0"), LONGEST_BODY)
        for values, tag in ((header.tags, MAKE), (header.tags, MODEL), (header.exif, 0xA431))
    )
    if make and model.lower().startswith(make.lower()):
        make = ""
    return " ".join(part for part in (make, model, serial) if part)


def _exposure_ev(header: Header) -> float | None:
    """log2(t ISO / (100 N^2)): the light that reaches the file, in stops."""
    of = partial(_number, header.exif)
    time_s, f_number, iso = of(0x829A), of(0x829D), of(0x8827)
    low, high = EXPOSURE_BOUNDS
    if not (time_s and f_number and iso) or not all(
        low <= value <= high for value in (time_s, f_number, iso)
    ):
        return None
    return math.log2(time_s * iso / 100 / f_number**2)

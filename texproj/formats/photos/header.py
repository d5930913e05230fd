"""What a photo file's header tells: size, orientation, lens, exposure, color profile."""

from __future__ import annotations

import io
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from texproj.errors import InputError
from texproj.formats.foreign import Broken, foreign_parser
from texproj.formats.photos.exif import (
    body_of,
    directories_of,
    exposure_ev_of,
    focal_px_of,
    quiet,
    read_or_none,
    rights_of,
    taken_of,
)
from texproj.formats.photos.exr import exr_stored
from texproj.formats.photos.gravity import LONGEST_XMP, XMP, up_of
from texproj.formats.photos.heif import MissingReaderError, avif_stored, brand_of, heic_stored
from texproj.formats.photos.icc import adobe_rgb, usable
from texproj.formats.photos.kinds import RAW_SUFFIXES, SAID
from texproj.formats.photos.lens_data import known_lens
from texproj.formats.photos.raster import Stored
from texproj.formats.photos.raw import RAW_MAGIC, raw_stored
from texproj.formats.photos.tiff import MAGIC, directories, photo_page
from texproj.photo import LARGEST_PHOTO_MP, PhotoInfo

LONGEST_SIDE_PX = 32_766
"""What OpenCV's remap can take from and give."""

MOST_EXIF_BYTES = 16 << 20

OTHER_IMAGES = {
    b"GIF8": "GIF", b"BM": "BMP", b"RIFF": "WebP", b"8BPS": "Photoshop", b"%PDF": "PDF",
    b"#?RADIANCE": "HDR", b"\xff\x4f\xff\x51": "JPEG 2000", b"\0\0\0\x0cjP": "JPEG 2000",
}  # fmt: skip
"""Kinds of images by their first bytes, so that their name can be told."""

ORIENTATION, ICC_PROFILE = 274, 34675
COLOR_SPACE, INTEROP_INDEX = 0xA001, 1
DNG_VERSION = 50706
FLOATING = (
    "floating point without a color profile: taken as linear light"
    " ([develop] float_light can say sRGB)"
)
CFA, LINEAR_RAW = 32803, 34892
"""What TIFF calls the pixels of a sensor, mosaicked or not."""


@dataclass(frozen=True)
class Header:
    """The header of a photo file, sizes as stored.

    kind: a key of `KINDS`; channels: 1 gray, 3 RGB, 4 CMYK, alpha not counted;
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
    """What the header of a photo says; no pixel is decoded.

    Raises InputError for a file that is missing, empty, broken, no such image, or of more than
    `largest_mp` million pixels.
    """
    try:
        with path.open("rb") as file:
            header = header_of(path, file, largest_mp)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    width, height = header.upright_size
    focal_px, notes = focal_px_of(header)
    if not header.exif:
        notes = ("no EXIF data: focal length and exposure are unknown",)
    lens = known_lens(header, focal_px)
    lens_light = lens.lens_light if header.kind == "RAW" else ()
    if lens.distortion or lens_light:
        told = ["distortion starts from there"] if lens.distortion else []
        told += ["the light that it loses to the corners is given back"] if lens_light else []
        notes = (*notes, f"its lens, {lens.name}, is in lensfun's database: {', '.join(told)}")
    return PhotoInfo(
        path.name, width, height, focal_px, body_of(header), exposure_ev_of(header),
        (*header.notes, *notes), header.orientation, *rights_of(header), taken_of(header),
        lens.distortion, up_of(header), lens_light,
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
    try:
        with foreign_parser():
            stored = _stored(path, file, start, what)
    except MissingReaderError as error:
        raise InputError(f"{path}: {error}") from None
    except Broken as error:
        told = "a damaged TIFF file" if start[:4] in MAGIC else "damaged"
        raise InputError(f"{path}: the {what} is {told} ({error}); copy it again") from None
    _check_size(path, stored.width, stored.height, largest_mp)
    return _header(stored)


def _stored(path: Path, file: io.BufferedIOBase, start: bytes, what: str) -> Stored:
    """What the file tells, by the parser for its first bytes."""
    if start[:3] == b"\xff\xd8\xff" or start[:4] == b"\x89PNG":
        return _pillow(file)
    if start.startswith(b"v/1\x01"):
        return exr_stored(file)
    if start[4:8] == b"ftyp" and (kind := brand_of(start)):
        return {"RAW": raw_stored, "HEIC": heic_stored, "AVIF": avif_stored}[kind](file)
    if start.startswith(RAW_MAGIC):
        return raw_stored(file)
    if start[:4] in MAGIC:
        return raw_stored(file) if path.suffix.lower() in RAW_SUFFIXES else _tiff(path, file, what)
    raise InputError(f"{path}: {_what_else(start)}")


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
    """A sentence about a file of no kind that is read."""
    kind = next((name for magic, name in OTHER_IMAGES.items() if start.startswith(magic)), None)
    if kind:
        return f"a {kind} image; convert it to jpg, png or tiff"
    is_text = start.isascii() and b"\0" not in start
    return f"not a photo ({SAID}) but {'text' if is_text else 'an unknown format'}"


def _pillow(file: io.BufferedIOBase) -> Stored:
    from PIL import Image  # noqa: PLC0415

    Image.MAX_IMAGE_PIXELS = None  # `_check_size` has the limit
    with quiet():
        image = Image.open(file, formats=("JPEG", "PNG"))
    kind = "PNG" if image.format == "PNG" else "JPEG"
    channels = {"C": 4, "L": 1, "1": 1, "I": 1}.get(image.mode[0], 3)
    profile = image.info.get("icc_profile")
    block = image.info.get("exif") or b"" if kind == "JPEG" else _png_exif(file)
    tags, exif = read_or_none(lambda: directories_of(block))
    xmp = image.info.get("xmp")
    if isinstance(xmp, bytes) and len(xmp) <= LONGEST_XMP:
        tags = {**tags, XMP: xmp}
    return Stored(kind, image.width, image.height, channels, profile, tags, exif)


def _tiff(path: Path, file: io.BufferedIOBase, what: str) -> Stored:
    with photo_page(file) as (page, first, note):
        size = (int(page.imagewidth), int(page.imagelength))
        photometric = int(page.photometric)
        tags, exif = read_or_none(lambda: directories(page, first))
        floats = page.dtype is not None and page.dtype.kind == "f"
    if DNG_VERSION in tags or photometric in (CFA, LINEAR_RAW):
        file.seek(0)
        return raw_stored(file)
    if min(size) < 1:
        raise InputError(f"{path}: the {what} is a damaged TIFF file without a size; copy it again")
    channels = {0: 1, 1: 1, 5: 4}.get(photometric, 3)
    notes = (note,) if note else ()
    if floats and not tags.get(ICC_PROFILE):
        notes = (*notes, FLOATING)
    return Stored("TIFF", *size, channels, tags.get(ICC_PROFILE), tags, exif, notes)


def _header(stored: Stored) -> Header:
    """The header with what is wrong in it mended, and said."""
    tags, exif, given = stored.tags, stored.exif, stored.profile
    orientation = stored.orientation or tags.get(ORIENTATION, 1)
    if orientation not in range(1, 9):
        orientation = 1
    profile = given if isinstance(given, bytes) else b"-" if given else b""
    if not profile and exif.get(COLOR_SPACE) == 0xFFFF and exif.get(INTEROP_INDEX) == "R03":
        profile = adobe_rgb()  # DCF 2.0: how cameras mark Adobe RGB without embedding a profile
    if stored.kind == "RAW":
        profile = b""  # what the camera made its preview with
    notes = stored.notes
    if profile and not usable(profile, stored.channels):
        broken = "its color profile is broken or of another kind: sRGB is assumed"
        profile, notes = b"", (*notes, broken)
    if stored.channels == 4 and not profile:
        notes = (*notes, "CMYK without a color profile: colors are a guess")
    return Header(
        stored.kind, stored.width, stored.height, stored.channels, int(orientation), profile,
        tags, exif, notes,
    )  # fmt: skip


def _png_exif(file: io.BufferedIOBase) -> bytes:
    """The EXIF block of a PNG, before or after its pixels, which Pillow would decode for it."""
    file.seek(8)
    while len(head := file.read(8)) == 8:
        length, kind = struct.unpack(">I4s", head)
        if kind == b"eXIf":
            return file.read(min(length, MOST_EXIF_BYTES))
        file.seek(length + 4, io.SEEK_CUR)
    return b""

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

from texproj.errors import InputError
from texproj.formats.photos.icc import adobe_rgb, usable
from texproj.photo import PhotoInfo

Tags = dict[int, Any]

PHOTO_SUFFIXES = (".jpg", ".jpeg", ".png", ".tif", ".tiff")

DIAGONAL_35MM = math.hypot(36, 24)
MM_PER_UNIT = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}
"""EXIF ResolutionUnit and FocalPlaneResolutionUnit: inch, cm, mm, micrometre."""

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


def read_photo_info(path: Path) -> PhotoInfo:
    """What the header of a jpg, png or tiff says; no pixel is decoded.

    Raises InputError for a file that is missing, empty, broken or no such image.
    """
    try:
        with path.open("rb") as file:
            header = header_of(path, file)
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


def header_of(path: Path, file: io.BufferedIOBase) -> Header:
    """The header of an open image file; `path` is only for messages. Raises InputError."""
    start = file.read(16)
    file.seek(0)
    if not start.strip(b"\0 \t\r\n"):
        raise InputError(f"{path}: the photo is empty; copy it again")
    if start[:4] in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"):
        return _tiff_header(path, file)
    return _pillow_header(path, file)


def _pillow_header(path: Path, file: io.BufferedIOBase) -> Header:
    from PIL import Image  # noqa: PLC0415

    Image.MAX_IMAGE_PIXELS = None  # photos of 200 megapixels are no attack
    try:
        with quiet():
            image = Image.open(file)
    except (OSError, ValueError, SyntaxError) as error:
        raise InputError(f"{path}: {_broken(file, error)}") from None
    kind = "JPEG" if image.format == "MPO" else image.format
    if kind not in ("JPEG", "PNG"):
        raise InputError(f"{path}: a {kind} image; convert it to jpg, png or tiff")
    channels = {"C": 4, "L": 1, "1": 1, "I": 1}.get(image.mode[0], 3)
    profile = image.info.get("icc_profile") or b""
    block = image.info.get("exif") or b"" if kind == "JPEG" else _png_exif(file)
    return _header(kind, (*image.size, channels), profile, *_exif(lambda: _directories(block)))


def _tiff_header(path: Path, file: io.BufferedIOBase) -> Header:
    """By hand down to the tags: Pillow refuses many a TIFF for its pixels."""
    tags, photo = _exif(lambda: _tiff_directories(file))
    size = (tags.get(256, 0), tags.get(257, 0))
    if not all(isinstance(side, int) and side > 0 for side in size):
        raise InputError(f"{path}: a damaged TIFF file (its header tells no size); copy it again")
    channels = {0: 1, 1: 1, 5: 4}.get(tags.get(262, 2), 3)
    return _header("TIFF", (*size, channels), tags.get(ICC_PROFILE, b""), tags, photo)


def _tiff_directories(file: io.BufferedIOBase) -> tuple[Tags, Tags]:
    from PIL.TiffImagePlugin import ImageFileDirectory_v2  # noqa: PLC0415

    head = file.read(8)
    if b"+" in head[2:4]:  # BigTIFF
        head += file.read(8)
    found: list[Tags] = []
    offset = ImageFileDirectory_v2(head).next
    while offset is not None:
        directory = ImageFileDirectory_v2(head)
        file.seek(offset)
        directory.load(file)
        found.append(dict(directory))
        offset = found[0].get(EXIF_IFD) if len(found) == 1 else None
    return found[0], (*found, {})[1]


def _header(
    kind: str, shape: tuple[int, int, int], profile: bytes,
    tags: Mapping[int, Any], exif: Mapping[int, Any],
) -> Header:  # fmt: skip
    orientation = tags.get(ORIENTATION, 1)
    if orientation not in range(1, 9):
        orientation = 1
    if not profile and exif.get(COLOR_SPACE) == 0xFFFF and exif.get(INTEROP_INDEX) == "R03":
        profile = adobe_rgb()  # DCF 2.0: how cameras mark Adobe RGB without embedding a profile
    notes: tuple[str, ...] = ()
    if profile and not usable(bytes(profile), shape[2]):
        profile, notes = b"", ("its color profile is broken or of another kind: sRGB is assumed",)
    if shape[2] == 4 and not profile:
        notes = (*notes, "CMYK without a color profile: colors are a guess")
    return Header(kind, *shape, orientation, bytes(profile), tags, exif, notes)


def _exif(load: Callable[[], tuple[Tags, Tags]]) -> tuple[Tags, Tags]:
    """Main and photo directory; what is broken in them is left out: they are a nicety only."""
    with quiet():
        try:
            return load()
        except (OSError, ValueError, SyntaxError, KeyError, TypeError, struct.error):
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
            return file.read(length)
        file.seek(length + 4, io.SEEK_CUR)
    return b""


def _broken(file: io.BufferedIOBase, error: Exception) -> str:
    file.seek(0)
    head = file.read(64)
    if head[:3] == b"\xff\xd8\xff" or head[:4] == b"\x89PNG":
        return f"the photo is damaged ({' '.join(str(error).split())[:80]}); copy it again"
    kind = "text" if head.isascii() and b"\0" not in head else "an unknown format"
    return f"not a jpg, png or tiff photo but {kind}"


def _number(values: Mapping[int, Any], tag: int) -> float | None:
    """A positive finite EXIF number, None if absent, zero or broken."""
    value = values.get(tag)
    if isinstance(value, tuple | list):
        value = value[0] if value else None
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, ZeroDivisionError):
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
        return by_35mm, (*notes, "the two focal lengths in EXIF disagree: the 35 mm one is used")
    if not (by_plane or by_35mm):
        notes = (*notes, "EXIF tells no focal length that could be turned into pixels")
    return by_plane or by_35mm, notes


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
        str(values.get(tag) or "").strip(" \0")
        for values, tag in ((header.tags, MAKE), (header.tags, MODEL), (header.exif, 0xA431))
    )
    if make and model.lower().startswith(make.lower()):
        make = ""
    return " ".join(part for part in (make, model, serial) if part)


def _exposure_ev(header: Header) -> float | None:
    """log2(t ISO / (100 N^2)): the light that reaches the file, in stops."""
    of = partial(_number, header.exif)
    time_s, f_number, iso = of(0x829A), of(0x829D), of(0x8827)
    if not (time_s and f_number and iso):
        return None
    return math.log2(time_s * iso / 100 / f_number**2)

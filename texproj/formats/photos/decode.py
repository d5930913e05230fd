"""Pixels as stored: photos of any kind and depth to arrays; of RAW files, developed ones."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from texproj.errors import InputError
from texproj.formats.foreign import Broken, foreign_parser
from texproj.formats.photos.exif import quiet
from texproj.formats.photos.exr import exr_raster
from texproj.formats.photos.header import Header
from texproj.formats.photos.heif import avif_raster, heic_raster
from texproj.formats.photos.raster import Raster, Values
from texproj.formats.photos.raw import raw_raster
from texproj.formats.photos.tiff import tiff_raster
from texproj.options import DevelopOptions

START_OF_SCAN, END_OF_IMAGE = 0xDA, b"\xff\xd9"


@dataclass(frozen=True)
class Wish:
    """How a photo is wanted. longest: pixels of its longer side that are enough, None = all."""

    longest: int | None = None
    develop: DevelopOptions = field(default_factory=DevelopOptions)


def decode(path: Path, data: bytes, header: Header, wish: Wish, what: str) -> Raster:
    """All pixels of a photo; JPEG and RAW are decoded reduced where the wish allows.

    Raises InputError for damaged files, of what kind (photo, mask) says `what`.
    """
    try:
        with foreign_parser():
            raster = DECODERS[header.kind](data, header, wish)
    except Broken as error:
        raise InputError(f"{path}: the {what} is damaged ({error}); copy it again") from None
    shape = raster.values.shape[1::-1]
    if shape != (header.width, header.height) and header.kind not in ("JPEG", "RAW"):
        raise InputError(
            f"{path}: the {what} is damaged (its header tells {header.width} x {header.height}"
            f" pixels, there are {shape[0]} x {shape[1]}); copy it again"
        )
    return raster


def _jpeg(data: bytes, header: Header, wish: Wish) -> Raster:
    if header.channels == 4:
        return _cmyk_jpeg(data)
    if not _ends(data):
        raise Broken("its data end early")
    factor = reduction(header, wish.longest)
    pixels = _whole_jpeg(data) if factor == 1 else _reduced_jpeg(data, factor)
    return Raster(pixels[..., :1] if header.channels == 1 else pixels)


def _whole_jpeg(data: bytes) -> Values:
    """(h, w, 1 or 3) pixels; bit by bit as OpenCV decodes them, in half of its memory."""
    import imagecodecs  # noqa: PLC0415

    return np.atleast_3d(imagecodecs.jpeg8_decode(data))


def _reduced_jpeg(data: bytes, factor: int) -> Values:
    """(h, w, 3) pixels of a picture reduced by 2, 4 or 8 in the frequencies of its blocks."""
    reduced = {2: 16, 4: 32, 8: 64}[factor]
    flags = cv2.IMREAD_COLOR_RGB | cv2.IMREAD_IGNORE_ORIENTATION | reduced
    pixels = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    if pixels is None:
        raise Broken("its data cannot be decoded")
    return pixels


def _ends(data: bytes) -> bool:
    """Whether the end marker of a JPEG follows its first scan.

    The decoder fills a picture that breaks off with gray and says so on the terminal only. The
    segments before the scan are skipped by their lengths: a thumbnail in them has an end too.
    """
    at = 2
    while data[at : at + 1] == b"\xff" and data[at + 1] != START_OF_SCAN:
        filler = data[at + 1] == 0xFF
        at += 1 if filler else 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    return data.find(END_OF_IMAGE, at) >= 0


def reduction(header: Header, longest: int | None) -> int:
    """Largest of 1, 2, 4, 8 that leaves `longest` pixels and divides the size without rest.

    With a rest, the last pixels would stand for a strip of another width and shift the picture.
    """
    width, height = header.width, header.height
    for factor in (8, 4, 2):
        fits = longest is not None and max(width, height) >= longest * factor
        if fits and not (width % factor or height % factor):
            return factor
    return 1


def _cmyk_jpeg(data: bytes) -> Raster:
    from PIL import Image  # noqa: PLC0415

    with quiet():
        return Raster(np.array(Image.open(io.BytesIO(data))))


def _png(data: bytes, header: Header, wish: Wish) -> Raster:
    import imagecodecs  # noqa: PLC0415

    pixels = np.atleast_3d(imagecodecs.png_decode(data))
    count = pixels.shape[2]
    if count in (2, 4):
        return Raster(pixels[..., : count - 1], pixels[..., -1])
    return Raster(pixels)


DECODERS: dict[str, Callable[[bytes, Header, Wish], Raster]] = {
    "JPEG": _jpeg,
    "PNG": _png,
    "TIFF": lambda data, header, wish: tiff_raster(io.BytesIO(data)),
    "RAW": lambda data, header, wish: raw_raster(data, wish.longest, wish.develop),
    "HEIC": lambda data, header, wish: heic_raster(data),
    "AVIF": lambda data, header, wish: avif_raster(data),
    "OpenEXR": lambda data, header, wish: exr_raster(data),
}
"""By the kind of the file."""

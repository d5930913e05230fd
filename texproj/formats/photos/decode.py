"""Pixels as stored: jpg, png and tiff of any depth to arrays, nothing converted."""

from __future__ import annotations

import io
import logging
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.errors import InputError
from texproj.formats.photos.header import Header, quiet
from texproj.formats.photos.icc import Values

START_OF_SCAN, END_OF_IMAGE = 0xDA, b"\xff\xd9"


@dataclass(frozen=True, eq=False)
class Raster:
    """Decoded pixels, not yet upright, in the encoding of the file.

    values: (h, w, c) uint8, uint16 or float32 (already linear unless a profile says otherwise),
    c = 1 gray, 3 RGB, 4 CMYK with full value = full ink; alpha: (h, w) of the same type or None.
    """

    values: Values
    alpha: NDArray[Any] | None = None


def decode(path: Path, data: bytes, header: Header, longest: int | None) -> Raster:
    """All pixels of a photo; a JPEG is decoded at 1/2, 1/4 or 1/8 where `longest` allows.

    Raises InputError for damaged files.
    """
    decoders = {"JPEG": _jpeg, "PNG": _png, "TIFF": _tiff}
    try:
        return decoders[header.kind](data, header, longest)
    except _DECODER_ERRORS as error:
        reason = " ".join(str(error).split())[:80]
        raise InputError(f"{path}: the photo is damaged ({reason}); copy it again") from None


_DECODER_ERRORS = (
    OSError, ValueError, RuntimeError, SyntaxError, KeyError, IndexError, TypeError, EOFError,
    AttributeError, MemoryError, ArithmeticError, struct.error, zlib.error, cv2.error,
)  # fmt: skip
"""What decoders of other hands raise on damaged files."""


def _jpeg(data: bytes, header: Header, longest: int | None) -> Raster:
    if header.channels == 4:
        return _cmyk_jpeg(data)
    reduced = {1: 0, 2: 16, 4: 32, 8: 64}[reduction(header, longest)]
    flags = cv2.IMREAD_COLOR_RGB | cv2.IMREAD_IGNORE_ORIENTATION | reduced
    pixels = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    if pixels is None or not _ends(data):
        raise ValueError("its data end early")
    return Raster(pixels[..., :1] if header.channels == 1 else pixels)


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


def _png(data: bytes, header: Header, longest: int | None) -> Raster:
    import imagecodecs  # noqa: PLC0415

    pixels = np.atleast_3d(imagecodecs.png_decode(data))
    count = pixels.shape[2]
    if count in (2, 4):
        return Raster(pixels[..., : count - 1], pixels[..., -1])
    return Raster(pixels)


def _tiff(data: bytes, header: Header, longest: int | None) -> Raster:
    import tifffile  # noqa: PLC0415

    logging.getLogger("tifffile").addHandler(logging.NullHandler())  # else it prints
    try:
        tiff = tifffile.TiffFile(io.BytesIO(data))
    except tifffile.TiffFileError as error:
        raise ValueError(str(error)) from None
    with tiff:
        page = tiff.pages.first
        pixels = page.asarray()
        axes = page.axes.replace("Z", "")
        if axes == "SYX":
            pixels = np.moveaxis(pixels, 0, -1)
        elif axes not in ("YX", "YXS"):
            raise ValueError(f"a stack of images with axes {axes}")
        pixels = _full_range(np.atleast_3d(pixels), page.bitspersample)
        return _tiff_colors(pixels, page.photometric.name, page.colormap)


def _full_range(pixels: NDArray[Any], bits: int) -> Values:
    """uint8, uint16 or float32; 1- or 12-bit values spread over the whole range of their type."""
    if pixels.dtype == bool:
        return pixels.astype(np.uint8) * 255
    if pixels.dtype.kind == "f":
        return pixels.astype(np.float32)
    if pixels.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"pixels of type {pixels.dtype}")
    full = np.iinfo(pixels.dtype).max
    if bits < pixels.dtype.itemsize * 8:
        top = 2**bits - 1
        pixels = ((pixels.astype(np.uint32) * full + top // 2) // top).astype(pixels.dtype)
    return np.ascontiguousarray(pixels)


def _tiff_colors(pixels: Values, photometric: str, colormap: NDArray[Any] | None) -> Raster:
    colors = {"MINISWHITE": 1, "MINISBLACK": 1, "RGB": 3, "YCBCR": 3, "SEPARATED": 4}
    if photometric == "PALETTE" and colormap is not None:
        return Raster(_palette(colormap)[pixels[..., 0]])
    count = colors.get(photometric, 0)
    if not count or pixels.shape[2] < count:
        raise ValueError(f"{pixels.shape[2]} channels of kind {photometric}")
    values, alpha = pixels[..., :count], None
    if photometric == "MINISWHITE":
        values = np.iinfo(values.dtype).max - values
    if pixels.shape[2] == count + 1:
        alpha = pixels[..., count]
    return Raster(values, alpha)


def _palette(colormap: NDArray[Any]) -> Values:
    """(n, 3) colors of a (3, n) uint16 color map, as uint8 where it holds no more than that."""
    high, low = colormap >> 8, colormap & 255
    plain = ((low == 0) | (low == high)).all()
    return (high.astype(np.uint8) if plain else colormap).T

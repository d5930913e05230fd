"""TIFF files of any kind: which of their pictures is the photo, its tags, its pixels."""

from __future__ import annotations

import contextlib
import io
import logging
from collections.abc import Iterator, Mapping
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.formats.foreign import Broken
from texproj.formats.photos.raster import Raster, Tags, Values

Page = Any
"""tifffile's TiffPage."""

MAGIC = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
MOST_PAGES = 64
"""Pictures among which the photo is looked for."""
MOST_CHANNELS = 64
"""Colors and alphas; editors store at most 56."""

EXIF_IFD = 0x8769
FRACTIONS = (0x829A, 0x829D, 0x920A, 0xA20E, 0xA20F)
"""EXIF's time, f-number, focal length and resolutions of the focal plane."""
REDUCED, STENCIL = 1, 4
"""Bits of NewSubfileType: a smaller version of another picture, a mask for another."""

COLORS = {"MINISWHITE": 1, "MINISBLACK": 1, "RGB": 3, "YCBCR": 3, "SEPARATED": 4}


@contextlib.contextmanager
def photo_page(file: io.BufferedIOBase) -> Iterator[tuple[Page, Page, str]]:
    """The picture that is the photo, the file's first picture, and a note where these differ.

    The largest picture that is no reduced version and no mask of another: scanners, cameras and
    archives put a thumbnail first, and full pictures behind it or below it (SubIFDs).
    """
    import tifffile  # noqa: PLC0415

    logging.getLogger("tifffile").addHandler(logging.NullHandler())  # else it prints
    with tifffile.TiffFile(file) as tiff:
        first = tiff.pages.first
        found = [page for page in _pages(tiff) if isinstance(page, tifffile.TiffPage)]
        best = max(found, key=lambda page: (_stands_alone(page), _area(page)), default=first)
        small = f"{first.imagewidth} x {first.imagelength}"
        note = f"its first picture, {small}, is a reduced one: the largest is used"
        yield best, first, note if _area(best) > _area(first) else ""


def _pages(tiff: Any) -> Iterator[Page]:
    """Every picture of the file and those below it."""
    for index in range(MOST_PAGES):
        try:
            page = tiff.pages[index]
        except IndexError:
            return
        yield page
        if getattr(page, "subifds", None):
            yield from list(page.pages)[:MOST_PAGES]


def _stands_alone(page: Page) -> bool:
    return not int(page.subfiletype) & (REDUCED | STENCIL)


def _area(page: Page) -> int:
    return int(page.imagewidth) * int(page.imagelength)


def directories(page: Page, first: Page) -> tuple[Tags, Tags]:
    """The tags of the photo, over those of the file's first picture, and its EXIF tags."""
    pages = (first, page)
    tags = {tag.code: tag.value for p in pages for tag in p.tags if tag.code != EXIF_IFD}
    exif: Tags = {}
    for p in pages:
        exif |= _numbered(p.tags.valueof(EXIF_IFD))
    return tags, exif


def _numbered(named: Any) -> Tags:
    """EXIF tags by number; fractions as numbers."""
    from tifffile import TIFF  # noqa: PLC0415

    if not isinstance(named, Mapping):
        return {}
    exif = {}
    for name, value in named.items():
        code = int(name) if name.isdecimal() else TIFF.EXIF_TAGS.get(name)
        if code in FRACTIONS and isinstance(value, tuple) and len(value) == 2:
            value = value[0] / value[1] if value[1] else None  # noqa: PLW2901
        exif[code] = value
    return exif


def tiff_raster(file: io.BufferedIOBase) -> Raster:
    """The pixels of the photo. Raises Broken for kinds that are not read and for cut files."""
    with photo_page(file) as (page, _, _):
        _check(page)
        pixels = page.asarray()
        axes = page.axes.replace("Z", "")
        if axes == "SYX":
            pixels = np.moveaxis(pixels, 0, -1)
        elif axes not in ("YX", "YXS"):
            raise Broken(f"a stack of images with axes {axes}")
        pixels = _full_range(np.atleast_3d(pixels), page.bitspersample)
        return _with_colors(pixels, page.photometric.name, page.colormap)


def _check(page: Page) -> None:
    """Refuse, before anything is allocated, what cannot be a photo."""
    if page.dtype is None or page.dtype.kind not in "buf":
        raise Broken(f"pixels of {page.bitspersample} bits of kind {page.sampleformat!s}")
    if prod(page.shape) > _area(page) * MOST_CHANNELS:
        raise Broken(f"{page.samplesperpixel} channels, {page.imagedepth} deep")
    if page.is_tiled and page.tilewidth * page.tilelength > 4 * max(_area(page), 1 << 20):
        raise Broken(f"tiles of {page.tilewidth} x {page.tilelength}")
    size = page.parent.filehandle.size
    pieces = list(zip(page.dataoffsets, page.databytecounts, strict=False))
    if len(pieces) < prod(page.chunked) or any(
        count <= 0 or offset + count > size for offset, count in pieces
    ):
        raise Broken("its data end early")


def _full_range(pixels: NDArray[Any], bits: int) -> Values:
    """uint8, uint16 or float32; 1- or 12-bit values spread over the whole range of their type."""
    if pixels.dtype == bool:
        return pixels.astype(np.uint8) * 255
    if pixels.dtype.kind == "f":
        with np.errstate(over="ignore", invalid="ignore"):  # numbers beyond float32
            return pixels.astype(np.float32)
    if pixels.dtype not in (np.uint8, np.uint16):
        raise Broken(f"pixels of type {pixels.dtype}")
    full = np.iinfo(pixels.dtype).max
    if bits < pixels.dtype.itemsize * 8:
        top = 2**bits - 1
        pixels = ((pixels.astype(np.uint32) * full + top // 2) // top).astype(pixels.dtype)
    return np.ascontiguousarray(pixels)


def _with_colors(pixels: Values, photometric: str, colormap: NDArray[Any] | None) -> Raster:
    if photometric == "PALETTE" and colormap is not None:
        if colormap.ndim != 2 or len(colormap) != 3:
            raise Broken("its palette is damaged")
        colors = _palette(colormap)
        if pixels.dtype.kind != "u" or pixels.max(initial=0) >= len(colors):
            raise Broken("its palette is too short")
        return Raster(colors[pixels[..., 0]])
    count = COLORS.get(photometric, 0)
    if not count or pixels.shape[2] < count:
        raise Broken(f"{pixels.shape[2]} channels of kind {photometric}")
    values, alpha = pixels[..., :count], None
    if photometric == "MINISWHITE":
        values = (1 if values.dtype.kind == "f" else np.iinfo(values.dtype).max) - values
    if pixels.shape[2] == count + 1:
        alpha = pixels[..., count]
    return Raster(values, alpha)


def _palette(colormap: NDArray[Any]) -> Values:
    """(n, 3) colors of a (3, n) uint16 color map, as uint8 where it holds no more than that."""
    high, low = colormap >> 8, colormap & 255
    plain = ((low == 0) | (low == high)).all()
    return (high.astype(np.uint8) if plain else colormap).T

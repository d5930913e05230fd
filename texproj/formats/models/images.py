"""Images of textures as bytes, marked as sRGB; OpenEXR in linear light."""

from __future__ import annotations

import io
import os
import struct
import tempfile
import zlib
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.errors import OutputError
from texproj.formats.jpeg import jpeg_bytes
from texproj.photo import linear_from_srgb

Bytes = bytes | bytearray | memoryview

ImageFormat = Literal["png", "jpeg", "webp", "tiff", "exr"]

IMAGE_SUFFIXES: dict[ImageFormat, str] = {
    "png": ".png", "jpeg": ".jpg", "webp": ".webp", "tiff": ".tif", "exr": ".exr",
}  # fmt: skip

QUALITY = 95
"""Of lossy images, where nothing else is asked."""

LARGEST_WEBP = 16383
"""Pixels along a side: all that the format's 14 bits can say."""

CHROMATICITIES = (31270, 32900, 64000, 33000, 30000, 60000, 15000, 6000)
"""White point and primaries of sRGB (IEC 61966-2-1) x 100000, for PNG's cHRM."""

GAMMA = 45455
"""1 / 2.2 x 100000, for PNG's gAMA: what readers go by that do not know sRGB."""


def encode_image(pixels: NDArray[Any], kind: ImageFormat, quality: int = QUALITY) -> bytes:
    """(h, w, 3 or 4) sRGB-encoded uint8 or uint16 pixels, RGB order, row 0 on top, as a file.

    jpeg and webp hold 8 bits, jpeg no alpha: there the rest is rounded or left out; exr holds
    linear light in half precision, by sRGB's primaries. quality: of
    jpeg and webp, 1..100; 100 keeps every value in a webp. Raises OutputError for a page that is
    too large for a webp.
    """
    return b"".join(_parts(pixels, kind, quality))


def _parts(pixels: NDArray[Any], kind: ImageFormat, quality: int) -> Iterable[Bytes]:
    """The file in pieces that need not be put together in memory."""
    if kind == "png":
        return _png(pixels)
    if kind == "tiff":
        return (_tiff(pixels),)
    if kind == "exr":
        return (_exr(pixels),)
    return _jpeg(pixels, quality) if kind == "jpeg" else (_webp(pixels, quality),)


def numbered(count: int) -> tuple[str, ...]:
    """What the files of so many pages have after the model's name."""
    return tuple(f"_{i}" for i in range(count))


def page_files(stem: Path, endings: Sequence[str], suffix: str) -> list[Path]:
    """The files of a texture's pages: `stem`, what tells the page, and what tells the format."""
    return [stem.with_name(f"{stem.name}{ending}{suffix}") for ending in endings]


def write_pages(
    stem: Path,
    pages: Sequence[NDArray[Any]],
    kind: ImageFormat,
    quality: int = QUALITY,
    endings: Sequence[str] | None = None,
) -> list[Path]:
    """`encode_image` of each page into its file, on all processors; returns the files, which end
    with their number unless other `endings` are given.

    No more encoded pages are in memory than there are processors. Raises OSError, OutputError.
    """
    told = numbered(len(pages)) if endings is None else endings
    files = page_files(stem, told, IMAGE_SUFFIXES[kind])
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        jobs = [
            pool.submit(_write_page, file, page, kind, quality)
            for file, page in zip(files, pages, strict=True)
        ]
        for job in jobs:
            job.result()
    return files


def _write_page(file: Path, page: NDArray[Any], kind: ImageFormat, quality: int) -> None:
    with file.open("wb") as out:
        out.writelines(_parts(page, kind, quality))


def to_8_bit(pixels: NDArray[Any]) -> NDArray[np.uint8]:
    """uint8 as it is, uint16 rounded."""
    if pixels.dtype == np.uint8:
        return pixels
    return cv2.convertScaleAbs(pixels, alpha=1 / 257)


def _png(pixels: NDArray[Any]) -> Iterable[Bytes]:
    """Photographs hardly repeat: no search for repetitions, but the best prediction.

    Half the time of zlib's level 1 here, and smaller files; only flat images are larger.
    """
    import imagecodecs  # noqa: PLC0415

    data = imagecodecs.png_encode(
        np.ascontiguousarray(pixels),
        level=1,
        strategy=imagecodecs.PNG.STRATEGY.HUFFMAN_ONLY,
        filter=imagecodecs.PNG.FILTER.PAETH,
    )
    header_end = 33  # signature and IHDR
    tags = (
        _png_chunk(b"sRGB", b"\0"),  # rendering intent 0: perceptual
        _png_chunk(b"gAMA", struct.pack(">I", GAMMA)),
        _png_chunk(b"cHRM", struct.pack(">8I", *CHROMATICITIES)),
    )
    return data[:header_end], *tags, memoryview(data)[header_end:]


def _png_chunk(name: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))


def _jpeg(pixels: NDArray[Any], quality: int) -> Iterable[Bytes]:
    data = jpeg_bytes(to_8_bit(pixels[..., :3]), quality)
    body = b"ICC_PROFILE\0\1\1" + srgb_profile()
    segment = b"\xff\xe2" + (len(body) + 2).to_bytes(2, "big") + body
    at = 2  # after the start marker, and after JFIF's segment that must come first
    if data[2:4] == b"\xff\xe0":
        at = 4 + int.from_bytes(data[4:6], "big")
    return data[:at], segment, memoryview(data)[at:]


def _webp(pixels: NDArray[Any], quality: int) -> bytes:
    from PIL import Image  # noqa: PLC0415

    height, width = pixels.shape[:2]
    if max(width, height) > LARGEST_WEBP:
        raise OutputError(
            f"a webp holds at most {LARGEST_WEBP} pixels along a side, a page has"
            f" {max(width, height)}; set page_size in [unwrap], or another image format"
        )
    out = io.BytesIO()
    lossless = quality == 100
    Image.fromarray(to_8_bit(pixels)).save(
        out, "WEBP", icc_profile=srgb_profile(), lossless=lossless, exact=lossless,
        quality=0 if lossless else quality, method=0 if lossless else 4,
    )  # fmt: skip
    return out.getvalue()


def _tiff(pixels: NDArray[Any]) -> bytes:
    import tifffile  # noqa: PLC0415

    out = io.BytesIO()
    extra = {"extrasamples": ["unassalpha"]} if pixels.shape[2] == 4 else {}
    tifffile.imwrite(
        out, pixels, photometric="rgb", compression="zlib", predictor=True,
        iccprofile=srgb_profile(), metadata=None, **extra,
    )  # fmt: skip
    return out.getvalue()


def _exr(pixels: NDArray[Any]) -> bytes:
    """The format's own library writes to files alone."""
    import OpenEXR  # noqa: PLC0415

    top = np.iinfo(pixels.dtype).max
    table = linear_from_srgb(np.arange(top + 1) / top).astype(np.float16)
    light = np.ascontiguousarray(table[pixels[..., :3]])
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "page.exr"
        OpenEXR.File(header, {"RGB": light}).write(str(path))
        return path.read_bytes()


@lru_cache(maxsize=1)
def srgb_profile() -> bytes:
    """An ICC profile of sRGB."""
    import imagecodecs  # noqa: PLC0415

    return imagecodecs.cms_profile("srgb")

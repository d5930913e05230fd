"""Images of textures as bytes, marked as sRGB."""

from __future__ import annotations

import io
import os
import zlib
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

ImageFormat = Literal["png", "jpeg", "webp", "tiff"]

IMAGE_SUFFIXES: dict[ImageFormat, str] = {
    "png": ".png", "jpeg": ".jpg", "webp": ".webp", "tiff": ".tif",
}  # fmt: skip

JPEG_QUALITY = 95
WEBP_LOSSLESS = 101


def encode_image(pixels: NDArray[Any], kind: ImageFormat) -> bytes:
    """(h, w, 3 or 4) sRGB-encoded uint8 or uint16 pixels, RGB order, row 0 on top, as a file.

    jpeg and webp hold 8 bits, jpeg no alpha: there the rest is rounded or left out.
    """
    encoders = {"png": _png, "jpeg": _jpeg, "webp": _webp, "tiff": _tiff}
    return encoders[kind](pixels)


def encode_pages(pages: Iterable[NDArray[Any]], kind: ImageFormat) -> list[bytes]:
    """`encode_image` of each page, on all processors."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(lambda page: encode_image(page, kind), pages))


def to_8_bit(pixels: NDArray[Any]) -> NDArray[np.uint8]:
    """uint8 as it is, uint16 rounded."""
    if pixels.dtype == np.uint8:
        return pixels
    return ((pixels.astype(np.uint32) + 128) // 257).astype(np.uint8)


def _png(pixels: NDArray[Any]) -> bytes:
    """Photographs hardly repeat: no search for repetitions, but the best prediction.

    Half the time of zlib's level 1 here, and smaller files; only flat images are larger.
    """
    import imagecodecs  # noqa: PLC0415

    data = bytes(
        imagecodecs.png_encode(
            np.ascontiguousarray(pixels),
            level=1,
            strategy=imagecodecs.PNG.STRATEGY.HUFFMAN_ONLY,
            filter=imagecodecs.PNG.FILTER.PAETH,
        )
    )
    chunk = b"sRGB\0"  # rendering intent 0: perceptual
    header_end = 33  # signature and IHDR
    tag = b"\0\0\0\1" + chunk + zlib.crc32(chunk).to_bytes(4, "big")
    return data[:header_end] + tag + data[header_end:]


def _jpeg(pixels: NDArray[Any]) -> bytes:
    sampling = cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444
    data = _encoded(
        ".jpg", to_8_bit(pixels[..., :3]), cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY, *sampling
    )
    body = b"ICC_PROFILE\0\1\1" + srgb_profile()
    segment = b"\xff\xe2" + (len(body) + 2).to_bytes(2, "big") + body
    at = 2  # after the start marker, and after JFIF's segment that must come first
    if data[2:4] == b"\xff\xe0":
        at = 4 + int.from_bytes(data[4:6], "big")
    return data[:at] + segment + data[at:]


def _webp(pixels: NDArray[Any]) -> bytes:
    return _encoded(".webp", to_8_bit(pixels), cv2.IMWRITE_WEBP_QUALITY, WEBP_LOSSLESS)


def _tiff(pixels: NDArray[Any]) -> bytes:
    import tifffile  # noqa: PLC0415

    out = io.BytesIO()
    extra = {"extrasamples": ["unassalpha"]} if pixels.shape[2] == 4 else {}
    tifffile.imwrite(
        out, pixels, photometric="rgb", compression="zlib", predictor=True,
        iccprofile=srgb_profile(), metadata=None, **extra,
    )  # fmt: skip
    return out.getvalue()


@lru_cache(maxsize=1)
def srgb_profile() -> bytes:
    """An ICC profile of sRGB."""
    import imagecodecs  # noqa: PLC0415

    return imagecodecs.cms_profile("srgb")


def _encoded(suffix: str, pixels: NDArray[Any], *parameters: int) -> bytes:
    order = cv2.COLOR_RGB2BGR if pixels.shape[2] == 3 else cv2.COLOR_RGBA2BGRA
    done, data = cv2.imencode(suffix, cv2.cvtColor(pixels, order), parameters)
    if not done:
        raise ValueError(f"{pixels.shape} {pixels.dtype} pixels cannot be encoded as {suffix}")
    return data.tobytes()

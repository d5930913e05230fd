"""A photo file and its stencil to a `Photo`."""

from __future__ import annotations

import io
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.errors import InputError
from texproj.formats.documents import read_bytes
from texproj.formats.photos.decode import Wish, decode
from texproj.formats.photos.header import Header, header_of
from texproj.formats.photos.icc import is_srgb, linear_from_profile
from texproj.formats.photos.raster import Raster, Values
from texproj.options import DevelopOptions
from texproj.photo import LARGEST_PHOTO_MP, Photo, PhotoInfo, linear_from_srgb

Mask = NDArray[np.uint8]

MOST_BYTES_PER_PIXEL = 64
"""Of a file: four channels of double precision, and as much beside them."""

AS_USUAL = DevelopOptions()

BRIGHTEST = 1e6
"""Linear light beyond this is no measurement; half floats end at 65504."""


def read_photo(
    path: Path,
    info: PhotoInfo,
    mask: Path | Sequence[Path] | None = None,
    longest: int | None = None,
    largest_mp: float = LARGEST_PHOTO_MP,
    develop: DevelopOptions = AS_USUAL,
) -> Photo:
    """Decode a photo, upright, at most `longest` pixels wide and high.

    sRGB photos of 8 bits stay uint8; all others become float32 linear light of the sRGB
    primaries, values outside of 0..1 kept; pixels that are no finite number are black and never
    used. `mask`: stencil images of the upright photo's shape (0 = never use), combined with the
    photo's own alpha. Raises InputError for damaged files, for more than `largest_mp` million
    pixels and for a stencil of another shape.
    """
    data = read_bytes(path, _most_bytes(largest_mp))
    header = header_of(path, io.BytesIO(data), largest_mp)
    raster = decode(path, data, header, Wish(longest, develop), "photo")
    del data
    size = _target_size(*header.upright_size, longest)
    encoded = header.kind == "TIFF" and develop.float_light == "srgb"
    upright = _upright(_pixels(raster, header.profile, encoded), header)
    if header.kind == "RAW" and info.lens_light and develop.lens_light:
        upright = _evenly_lit(upright, info.lens_light)
    pixels, finite = _finite(_rgb(_sized(upright, size)))
    if finite is not None and not finite.any():
        raise InputError(f"{path}: no pixel of it is a finite number; export it again")
    stencils = [] if finite is None else [finite]
    if raster.alpha is not None:
        stencils.append(_upright(_stencil(raster.alpha), header))
    given = [mask] if isinstance(mask, Path) else mask or ()
    stencils += [_read_mask(one, info, header, largest_mp) for one in given]
    return Photo(info, pixels, _combined(stencils, size))


def _most_bytes(largest_mp: float) -> int:
    return int(largest_mp * 1e6 * MOST_BYTES_PER_PIXEL) + (64 << 20)


def _finite(pixels: Any) -> tuple[Any, Mask | None]:
    """The pixels with black in place of what is no number, and where they are numbers."""
    if pixels.dtype == np.uint8:
        return pixels, None
    good = (np.abs(pixels) <= BRIGHTEST).all(axis=2)
    if good.all():
        return pixels, None
    return np.where(good[..., None], pixels, np.float32(0)), good.astype(np.uint8) * 255


def _rgb(pixels: Any) -> Any:
    """(h, w) gray to three equal channels; gray stays one until here to save memory."""
    return pixels if pixels.ndim == 3 else np.repeat(pixels[..., None], 3, axis=2)


def _pixels(
    raster: Raster, profile: bytes, encoded: bool
) -> NDArray[np.uint8] | NDArray[np.float32]:
    """(h, w, 3) or, for gray, (h, w) uint8 sRGB or float32 linear. encoded: whether floating point
    without a profile is in sRGB encoding.
    """
    values = raster.values
    if profile and not is_srgb(profile):
        return linear_from_profile(values, profile)
    if values.shape[2] == 4:
        values = _rgb_of_cmyk(values)
    values = values[..., 0] if values.shape[2] == 1 else values
    if values.dtype == np.uint8:
        return np.ascontiguousarray(values)
    if values.dtype == np.uint16:
        return np.take(_linear_of_srgb16(), values)
    if not (profile or encoded):
        return np.ascontiguousarray(values)
    with np.errstate(over="ignore", invalid="ignore"):  # `_finite` takes what is no number
        return linear_from_srgb(np.maximum(values, 0))


def _rgb_of_cmyk(values: Values) -> Values:
    """The plain formula R = (1 - C)(1 - K) for inks without a profile, in the type of `values`."""
    if values.dtype.kind == "f":
        return (1 - values[..., :3]) * (1 - values[..., 3:])
    full = np.iinfo(values.dtype).max
    light = (full - values).astype(np.float32)
    return np.rint(light[..., :3] * light[..., 3:] / full).astype(values.dtype)


@lru_cache(maxsize=1)
def _linear_of_srgb16() -> NDArray[np.float32]:
    return linear_from_srgb(np.arange(65536) / 65535)


def _evenly_lit(pixels: NDArray[np.float32], lens_light: Sequence[float]) -> NDArray[np.float32]:
    """The pixels (h, w, 3) over what the lens lets through; see `PhotoInfo.lens_light`."""
    height, width = pixels.shape[:2]
    x, y = (((np.arange(side) + 0.5) - side / 2) ** 2 for side in (width, height))
    scale = 4 / (width**2 + height**2)
    r2 = np.add.outer((y * scale).astype(np.float32), (x * scale).astype(np.float32))
    terms = np.array([*reversed(lens_light), 1.0], np.float32)
    return np.asarray(pixels / np.polyval(terms, r2)[..., None])


def _upright(pixels: Any, header: Header) -> Any:
    """Pixels turned and mirrored as EXIF orientation 1..8 says."""
    if header.orientation >= 5:
        pixels = cv2.transpose(pixels)
    flip = {2: 1, 3: -1, 4: 0, 6: 1, 7: -1, 8: 0}.get(header.orientation)
    return pixels if flip is None else cv2.flip(pixels, flip)


def _target_size(width: int, height: int, longest: int | None) -> tuple[int, int]:
    if longest is None or longest >= max(width, height):
        return width, height
    factor = longest / max(width, height)
    return max(1, round(width * factor)), max(1, round(height * factor))


def _sized(pixels: Any, size: tuple[int, int]) -> Any:
    if pixels.shape[1::-1] == size:
        return pixels
    return cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)


def _stencil(values: NDArray[Any]) -> Mask:
    """Any depth to uint8; what is not zero stays so, what is no number becomes zero."""
    if values.dtype == np.uint8:
        return np.ascontiguousarray(values)
    full = 1.0 if values.dtype.kind == "f" else float(np.iinfo(values.dtype).max)
    values = np.nan_to_num(values, nan=0.0) if values.dtype.kind == "f" else values
    return np.ceil(np.clip(values / full, 0, 1) * 255).astype(np.uint8)


def _read_mask(path: Path, info: PhotoInfo, photo: Header, largest_mp: float) -> Mask:
    """The stencil file, at its own size; its EXIF orientation is ignored.

    One that has the stored photo's shape and not the upright one's was painted on the stored
    picture, and is turned with it.
    """
    data = read_bytes(path, _most_bytes(largest_mp))
    header = header_of(path, io.BytesIO(data), largest_mp, "mask")
    width, height = header.width, header.height
    lies = photo.orientation >= 5 and _same_shape((width, height), (info.height, info.width))
    if _same_shape((width, height), (info.width, info.height)):
        lies = False
    elif not lies:
        raise InputError(
            f"{path}: the mask is {width} x {height}, but the upright photo {info.name}"
            f" is {info.width} x {info.height}; give it the same shape"
        )
    mask = _mask_of_image(decode(path, data, header, Wish(), "mask"))
    return _upright(mask, photo) if lies else mask


def _same_shape(one: tuple[int, int], other: tuple[int, int]) -> bool:
    """Whether one picture is the other but for scale."""
    return abs(one[0] * other[1] - one[1] * other[0]) <= max(other)


def _mask_of_image(raster: Raster) -> Mask:
    """Brightest color channel; with an alpha channel, where both let through.

    An image of one color says nothing by its color: there alpha speaks alone.
    """
    bright = _stencil(raster.values.max(axis=2))
    if raster.alpha is None:
        return bright
    alpha = _stencil(raster.alpha)
    return alpha if bright.min() == bright.max() else np.minimum(bright, alpha)


def _combined(stencils: list[Mask], size: tuple[int, int]) -> Mask | None:
    """The smallest value of all stencils at `size`; None where nothing is stenciled out."""
    result: Mask | None = None
    for stencil in stencils:
        sized = stencil
        if stencil.shape[1::-1] != size:
            sized = cv2.resize(stencil, size, interpolation=cv2.INTER_NEAREST_EXACT)
        result = sized if result is None else np.minimum(result, sized)
    return None if result is None or result.min() == 255 else result

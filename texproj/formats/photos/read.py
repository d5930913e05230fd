"""A photo file and its stencil to a `Photo`."""

from __future__ import annotations

import io
from functools import lru_cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.errors import InputError
from texproj.formats.photos.decode import Raster, decode
from texproj.formats.photos.header import Header, header_of
from texproj.formats.photos.icc import Values, is_srgb, linear_from_profile
from texproj.photo import Photo, PhotoInfo, linear_from_srgb

Mask = NDArray[np.uint8]


def read_photo(
    path: Path, info: PhotoInfo, mask: Path | None = None, longest: int | None = None
) -> Photo:
    """Decode a photo, upright, at most `longest` pixels wide and high.

    sRGB photos of 8 bits stay uint8; all others become float32 linear light of the sRGB
    primaries, values outside of 0..1 kept. `mask`: a stencil image of the upright photo's shape
    (0 = never use), combined with the photo's own alpha. Raises InputError for damaged files
    and for a stencil of another shape.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    header = header_of(path, io.BytesIO(data))
    raster = decode(path, data, header, longest)
    size = _target_size(*header.upright_size, longest)
    pixels = _sized(_upright(_pixels(raster, header.profile), header), size)
    alpha = None if raster.alpha is None else _stencil(raster.alpha)
    stencils = []
    if alpha is not None:
        stencils.append(_upright(alpha, header))
    if mask is not None:
        stencils.append(_read_mask(mask, info))
    return Photo(info, pixels, _combined(stencils, size))


def _pixels(raster: Raster, profile: bytes) -> NDArray[np.uint8] | NDArray[np.float32]:
    """(h, w, 3) uint8 sRGB or float32 linear."""
    values = raster.values
    if profile and not is_srgb(profile):
        return linear_from_profile(values, profile)
    if values.shape[2] == 4:
        values = _rgb_of_cmyk(values)
    values = np.repeat(values, 3, axis=2) if values.shape[2] == 1 else values
    if values.dtype == np.uint8:
        return np.ascontiguousarray(values)
    if values.dtype == np.uint16:
        return np.take(_linear_of_srgb16(), values)
    return np.ascontiguousarray(values) if not profile else linear_from_srgb(np.maximum(values, 0))


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
    """Any depth to uint8; what is not zero stays so."""
    if values.dtype == np.uint8:
        return np.ascontiguousarray(values)
    full = 1.0 if values.dtype.kind == "f" else float(np.iinfo(values.dtype).max)
    return np.ceil(np.clip(values / full, 0, 1) * 255).astype(np.uint8)


def _read_mask(path: Path, info: PhotoInfo) -> Mask:
    """The stencil file, at its own size."""
    try:
        data = np.frombuffer(path.read_bytes(), np.uint8)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    flags = cv2.IMREAD_UNCHANGED | cv2.IMREAD_IGNORE_ORIENTATION
    image = cv2.imdecode(data, flags) if len(data) else None
    if image is None:
        raise InputError(f"{path}: the mask is damaged or no image; make it again")
    height, width = image.shape[:2]
    if abs(width * info.height - height * info.width) > max(info.width, info.height):
        raise InputError(
            f"{path}: the mask is {width} x {height}, but the upright photo {info.name}"
            f" is {info.width} x {info.height}; give it the same shape"
        )
    return _mask_of_image(image)


def _mask_of_image(image: NDArray[Any]) -> Mask:
    """Brightest color channel; with an alpha channel, where both let through.

    An image of one color says nothing by its color: there alpha speaks alone.
    """
    channels = np.atleast_3d(image)
    bright = _stencil(channels[..., :3].max(axis=2))
    if channels.shape[2] != 4:
        return bright
    alpha = _stencil(channels[..., 3])
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

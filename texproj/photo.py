"""Photographs, what is known about them before any pixel is read, and picks on them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

LARGEST_PHOTO_MP = 400.0
"""Million pixels of the largest photo that is read where nobody asks for more: what fits in 2 GB
of memory, and four times what cameras take.
"""


@dataclass(frozen=True)
class PhotoInfo:
    """What a photo's header says. Sizes are those of the upright image (EXIF orientation applied).

    name: file name inside the project's photo folder; focal_px: focal length in pixels of the
    upright full-size image from EXIF, None if not told; camera_body: maker, model and serial
    number, empty if not told; exposure_ev: log2 of the light that the settings (time, aperture,
    ISO) gather, None if not told; notes: what was missing or odd, one sentence each;
    orientation: the EXIF orientation, 1..8, that made the photo upright; copyright, artist: EXIF's
    words, taken: when, ISO 8601 in the camera's time; empty if not told; distortion: k1 k2 p1 p2 k3
    of the lens that EXIF names, from a database, a start; empty if not known; up_in_cam: what was
    upward, as the camera has measured: unit x right, y down, z forward; empty if not told;
    lens_light: (3,) k of a RAW file's lens: 1 + k1 r^2 + k2 r^4 + k3 r^6, r in half diagonals, is
    the light over that in the middle (of JPEGs it is not known, which cameras correct mostly).
    """

    name: str
    width: int
    height: int
    focal_px: float | None = None
    camera_body: str = ""
    exposure_ev: float | None = None
    notes: tuple[str, ...] = ()
    orientation: int = 1
    copyright: str = ""
    artist: str = ""
    taken: str = ""
    distortion: tuple[float, ...] = ()
    up_in_cam: tuple[float, ...] = ()
    lens_light: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class Photo:
    """A decoded, upright photo, maybe at reduced size.

    pixels: (h, w, 3) RGB, either uint8 in sRGB encoding or float32 in linear light (1 = white).
    mask: (h, w) uint8 or None; 0 = never use this pixel (stencil and alpha together).
    """

    info: PhotoInfo
    pixels: NDArray[np.uint8] | NDArray[np.float32]
    mask: NDArray[np.uint8] | None = None

    @property
    def width(self) -> int:
        return int(self.pixels.shape[1])

    @property
    def height(self) -> int:
        return int(self.pixels.shape[0])

    @property
    def encoding(self) -> Literal["srgb", "linear"]:
        return "srgb" if self.pixels.dtype == np.uint8 else "linear"

    def linear(self) -> NDArray[np.float32]:
        """(h, w, 3) float32 linear light."""
        if self.encoding == "linear":
            return self.pixels.astype(np.float32, copy=False)
        import cv2  # noqa: PLC0415 - slow to load

        return cv2.LUT(self.pixels, LINEAR_OF_SRGB8)

    def srgb8(self) -> NDArray[np.uint8]:
        """(h, w, 3) uint8 in sRGB encoding; the very pixels where they are that already."""
        if self.encoding == "srgb":
            return self.pixels.astype(np.uint8, copy=False)
        return np.round(srgb_from_linear(self.pixels) * 255).astype(np.uint8)

    def gray(self) -> NDArray[np.float32]:
        """(h, w) float32 luma in 0..1, sRGB-encoded: what an eye sees, for matching."""
        import cv2  # noqa: PLC0415 - slow to load

        if self.encoding == "srgb":
            return cv2.cvtColor(self.pixels, cv2.COLOR_RGB2GRAY).astype(np.float32) / 255
        return cv2.cvtColor(srgb_from_linear(self.pixels), cv2.COLOR_RGB2GRAY)

    def reduced(self, longest_px: float) -> Photo:
        """The photo with its longer side reduced to `longest_px`, itself if it is smaller."""
        factor = longest_px / max(self.width, self.height)
        if factor >= 1:
            return self
        return self.resized(*(max(1, round(side * factor)) for side in (self.width, self.height)))

    def resized(self, width: int, height: int) -> Photo:
        """The photo area-averaged to a smaller size."""
        import cv2  # noqa: PLC0415 - slow to load

        size = (width, height)
        pixels = cv2.resize(self.pixels, size, interpolation=cv2.INTER_AREA)
        mask = None
        if self.mask is not None:
            mask = cv2.resize(self.mask, size, interpolation=cv2.INTER_NEAREST_EXACT)
        return replace(self, pixels=pixels, mask=mask)


@dataclass(frozen=True, eq=False)
class Correspondences:
    """Picked pairs of a photo's pixel and a point of the mesh.

    xy_px: (n, 2) float64 in full-size upright pixels; xyz_in_world: (n, 3) float64.
    names: one label each, by default its number from 1.
    """

    xy_px: NDArray[np.float64]
    xyz_in_world: NDArray[np.float64]
    names: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        xy = np.asarray(self.xy_px, np.float64).reshape(-1, 2)
        xyz = np.asarray(self.xyz_in_world, np.float64).reshape(-1, 3)
        if len(xy) != len(xyz):
            raise ValueError(f"{len(xy)} pixels and {len(xyz)} points do not pair up")
        object.__setattr__(self, "xy_px", xy)
        object.__setattr__(self, "xyz_in_world", xyz)
        object.__setattr__(self, "names", self.names or tuple(str(i + 1) for i in range(len(xy))))

    def __len__(self) -> int:
        return len(self.xy_px)


def linear_from_srgb(encoded: ArrayLike) -> NDArray[np.float32]:
    """sRGB values in 0..1 to linear light (IEC 61966-2-1)."""
    v = np.asarray(encoded, np.float32)
    return np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4).astype(np.float32)


def srgb_from_linear(linear: ArrayLike) -> NDArray[np.float32]:
    """Linear light, clipped to 0..1, to sRGB values (IEC 61966-2-1)."""
    v = np.clip(np.asarray(linear, np.float32), 0, 1)
    return np.where(v <= 0.0031308, v * 12.92, 1.055 * v ** (1 / 2.4) - 0.055).astype(np.float32)


LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
"""Of linear sRGB (Rec. 709)."""

LINEAR_OF_SRGB8 = linear_from_srgb(np.arange(256) / 255)
"""(256,) float32: linear light of each 8-bit sRGB value."""

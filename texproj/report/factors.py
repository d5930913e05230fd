"""Pictures of a photo's factors: one image each, and a sheet of all over the photo."""

from __future__ import annotations

from collections.abc import Mapping

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Bytes
from texproj.photo import Photo
from texproj.report.pictures import encoded

COLUMNS = 3
TILE_PX = 520
"""Longer side of a picture on the sheet."""
GAP_PX, CAPTION_PX = 14, 46
PAPER, INK, SOFT_INK = 255, (40, 40, 40), (120, 120, 120)
PHOTO_LEFT = 0.25
"""Part of the photo's gray that shines through a factor's color."""


def factor_image(values: NDArray[np.float32]) -> Bytes:
    """(h, w, 2) uint8 gray and alpha of a factor 0..1 that is nan where the mesh is not."""
    on_mesh = np.isfinite(values)
    gray = np.round(np.clip(np.where(on_mesh, values, 0), 0, 1) * 255)
    return np.dstack([gray, on_mesh * 255]).astype(np.uint8)


def factor_sheet(
    photo: Photo, factors: Mapping[str, NDArray[np.float32]], captions: Mapping[str, str]
) -> Bytes:
    """(h, w, 3) uint8: the photo, and each factor in colors over it, with its mean."""
    picture = encoded(photo)
    scale = min(1.0, TILE_PX / max(picture.shape[:2]))
    size = (round(picture.shape[1] * scale), round(picture.shape[0] * scale))
    small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    tiles = [_tile(small, photo.info.name, "The photo")]
    for name, values in factors.items():
        text = f"{name}: {np.nanmean(values):.2f}" if np.isfinite(values).any() else name
        tiles.append(_tile(_colored(small, values), text, captions[name]))
    while len(tiles) % COLUMNS:
        tiles.append(np.full_like(tiles[0], PAPER))
    rows = [np.hstack(tiles[k : k + COLUMNS]) for k in range(0, len(tiles), COLUMNS)]
    sheet = np.vstack([*rows, _legend(rows[0].shape[1])])
    return np.pad(sheet, ((GAP_PX, 0), (GAP_PX, 0), (0, 0)), constant_values=PAPER)


def _colored(picture: Bytes, values: NDArray[np.float32]) -> Bytes:
    """The values' colors over the photo in gray; outside of the mesh the dimmed photo."""
    size = (picture.shape[1], picture.shape[0])
    on_mesh = (
        cv2.resize(np.isfinite(values) * np.uint8(1), size, interpolation=cv2.INTER_NEAREST) > 0
    )
    small = cv2.resize(np.nan_to_num(values), size, interpolation=cv2.INTER_NEAREST)
    gray = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)[..., None].astype(np.float32)
    light = (1 - PHOTO_LEFT) * _ramp(small) + PHOTO_LEFT * gray
    return np.where(on_mesh[..., None], light, 160 + gray * 0.3).astype(np.uint8)


def _ramp(values: NDArray[np.float32]) -> Bytes:
    """(h, w, 3) uint8 RGB of values 0..1, dark blue to yellow."""
    index = np.round(np.clip(values, 0, 1) * 255).astype(np.uint8)
    return cv2.cvtColor(cv2.applyColorMap(index, cv2.COLORMAP_VIRIDIS), cv2.COLOR_BGR2RGB)


def _tile(picture: Bytes, title: str, caption: str) -> Bytes:
    """A picture with two lines below, and a margin at the right."""
    height, width = picture.shape[:2]
    out = np.full((height + CAPTION_PX + GAP_PX, width + GAP_PX, 3), PAPER, np.uint8)
    out[:height, :width] = picture
    _write(out, title, (0, height + 20), 0.55, INK)
    _write(out, caption, (0, height + 40), 0.45, SOFT_INK)
    return out


def _legend(width: int) -> Bytes:
    out = np.full((40, width, 3), PAPER, np.uint8)
    out[4:16, :256] = _ramp(np.linspace(0, 1, 256, dtype=np.float32)[None])
    _write(out, "0 counts nothing", (0, 34), 0.45, SOFT_INK)
    _write(out, "1 counts fully", (166, 34), 0.45, SOFT_INK)
    return out


def _write(
    image: Bytes, text: str, at: tuple[int, int], scale: float, ink: tuple[int, ...]
) -> None:
    plain = text.encode("ascii", "replace").decode()  # what the built-in font can draw
    cv2.putText(image, plain, at, cv2.FONT_HERSHEY_SIMPLEX, scale, ink, 1, cv2.LINE_AA)

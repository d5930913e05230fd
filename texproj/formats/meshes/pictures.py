"""The images of the textures that a mesh file brings."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.errors import InputError
from texproj.formats.documents import read_bytes
from texproj.formats.foreign import Broken, foreign_parser
from texproj.formats.meshes.mtl import FIRST_TILE
from texproj.layout import Material

MOST_BYTES = 2 << 30


def read_picture(material: Material, tile: int) -> NDArray[Any] | None:
    """(h, w, 3) uint8 or uint16, RGB, as encoded: the image of a material in one of its tiles; None
    where it has none. Raises InputError for one that cannot be read.
    """
    if material.image is None:
        if material.why:
            raise InputError(f"the texture of material {material.name!r}: {material.why}")
        return None
    image = material.image
    if isinstance(image, Path):
        image = read_bytes(picture_of_tile(image, tile), MOST_BYTES)
    if not image:
        raise InputError(f"the texture of material {material.name!r} is empty")
    try:
        with foreign_parser():
            pixels = cv2.imdecode(
                np.frombuffer(image, np.uint8), cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH
            )
    except Broken as error:
        raise InputError(f"the texture of material {material.name!r}: {error}") from None
    if pixels is None or pixels.dtype not in (np.uint8, np.uint16):
        raise InputError(f"the texture of material {material.name!r} cannot be read")
    return cv2.cvtColor(pixels, cv2.COLOR_BGR2RGB)


def picture_side(material: Material) -> int:
    """The longer side of a material's image, pixels, by its head alone; 0 where there is none or it
    says none.
    """
    from PIL import Image  # noqa: PLC0415

    if material.image is None:
        return 0
    given = material.image
    try:
        with (
            foreign_parser(),
            Image.open(io.BytesIO(given) if isinstance(given, bytes) else given) as head,
        ):
            return int(max(head.size))
    except Broken:
        return 0


def picture_of_tile(first: Path, tile: int) -> Path:
    """The file of another tile beside that of the first one, where it is there; else the first."""
    other = first.with_name(first.name.replace(FIRST_TILE, str(tile)))
    return other if other.is_file() else first

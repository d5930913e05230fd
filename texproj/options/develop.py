"""How photos that are no finished pictures are developed."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic.dataclasses import dataclass

from texproj.options.base import EXPERT, STRICT


@dataclass(frozen=True, config=STRICT)
class DevelopOptions:
    """How RAW files and floating-point pictures are read."""

    white_balance: Literal["camera", "daylight"] = "camera"
    """White balance of RAW files: as each shot's camera set it, or daylight, the same for all."""

    lens_light: Annotated[bool, EXPERT] = True
    """Give back the light that a RAW file's lens loses to the corners, where lensfun's database
    knows it at this focal length and aperture. What the photos tell is corrected after it."""

    pair: Annotated[Literal["raw", "jpeg"], EXPERT] = "raw"
    """Which file is the photo where a shot is there as RAW and as JPEG."""

    float_light: Annotated[Literal["linear", "srgb"], EXPERT] = "linear"
    """What floating-point TIFF files without a color profile hold: linear light, or sRGB values."""

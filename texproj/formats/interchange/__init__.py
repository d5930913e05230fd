"""Cameras of other programs: one module per format, all of them in our conventions."""

from texproj.formats.interchange.detect import detect, other_models
from texproj.formats.interchange.model import (
    ForeignCamera,
    ForeignModel,
    Shot,
    SizeOf,
    Written,
)
from texproj.formats.interchange.registry import (
    FISHEYE_WRITERS,
    FORMATS,
    READERS,
    WRITERS,
    CameraFormat,
)
from texproj.formats.interchange.upright import QUARTER_TURNS, upright

__all__ = [
    "FISHEYE_WRITERS",
    "FORMATS",
    "QUARTER_TURNS",
    "READERS",
    "WRITERS",
    "CameraFormat",
    "ForeignCamera",
    "ForeignModel",
    "Shot",
    "SizeOf",
    "Written",
    "detect",
    "other_models",
    "upright",
]

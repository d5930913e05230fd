"""Rendering, the web page, the demonstration."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from texproj.options.base import EXPERT, STRICT


@dataclass(frozen=True, config=STRICT)
class RenderOptions:
    """How images of the mesh are made."""

    renderer: Literal["auto", "gl", "cpu"] = "auto"
    """OpenGL, the ray caster on the processor, or whichever works (GL first)."""


@dataclass(frozen=True, config=STRICT)
class PreviewOptions:
    """How the web page is served."""

    host: Annotated[str, Field(min_length=1)] = "127.0.0.1"
    """Address to listen on. Beyond this machine a token is needed, which is printed."""

    port: Annotated[int, Field(ge=0, le=65535)] = 8765
    """Port to listen on; 0 = any free one."""

    light_faces: Annotated[int, Field(ge=1000), EXPERT] = 30_000
    """Meshes of more faces are shown with about so many while the view moves."""

    max_request_bytes: Annotated[int, Field(ge=1000), EXPERT] = 1_000_000
    """Longest request that is read."""


DemoLight = Literal["flash", "natural", "turntable"]
"""The light of a demo whose light is to be found."""


@dataclass(frozen=True, config=STRICT)
class DemoOptions:
    """A synthetic project with known truth."""

    object: Literal["shrine", "stele", "capital"] = "shrine"
    """What is carved."""
    seed: Annotated[int, Field(ge=0)] = 0
    """Another number, another piece, other photos; the same number gives the same bytes."""
    photos: Annotated[int, Field(ge=1, le=99)] = 12
    """Number of photos."""
    starts: bool = False
    """Photos all around, every second with picked points, the others with a rough camera; else
    photos of the front that overlap, and nothing is known of any."""
    long_side: Annotated[int, Field(ge=64, le=6000)] = 800
    """Longer side of the photos in pixels."""
    faces: Annotated[int, Field(ge=500, le=5_000_000)] = 60_000
    """Triangles of the scan, about."""
    carved_faces: Annotated[int, Field(ge=500, le=5_000_000)] = 300_000
    """Triangles of the true piece that is photographed, about."""
    scan_noise_mm: Annotated[float, Field(ge=0, le=20)] = 0.4
    """Standard deviation of the scan's noise along the surface normal."""
    start_error_px: Annotated[float, Field(ge=0, le=500)] = 40.0
    """Mean displacement of the piece in the rough cameras."""
    calibrated: bool = True
    """The rough cameras have the true lens; else only the focal length that EXIF tells."""
    pick_sigma_px: Annotated[float, Field(ge=0, le=50)] = 1.0
    """Standard deviation of the picks, along each axis."""
    paint: Annotated[float, Field(ge=0, le=1)] = 0.5
    """Share of the paint that is left on the stone; its edges are none of the shape."""
    gloss: Annotated[float, Field(ge=0, le=5)] = 0.5
    """Strength of the highlight; 0 is matte, 1 polished."""
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where the piece stands in the world; large values imitate survey coordinates."""

"""How cameras are found."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from texproj.options.base import STRICT, Fraction, Positive


@dataclass(frozen=True, config=STRICT)
class RegisterOptions:
    """How the cameras of the photos are found."""

    method: Literal[
        "auto", "points", "mutual-information", "silhouette", "structure", "features"
    ] = "auto"
    """Auto uses what the project has: picks, an approximate camera, a mask, other photos."""


@dataclass(frozen=True, config=STRICT)
class PointsOptions:
    """How a camera is solved from picked points."""

    solve: tuple[Literal["auto", "pose", "focal", "principal-point", "k1", "k2"], ...] = ("auto",)
    """What to solve besides the pose: auto = what is uncertain and what the picks contradict."""

    focal: Literal["auto", "known", "approximate", "unknown"] = "auto"
    """How far to trust the focal length at hand: auto = known if it comes from cameras.json,
    unless the picks contradict it; approximate if from EXIF; unknown if there is none."""

    pick_sigma_percent: Positive = 0.07
    """Usual noise of a pick, percent of the photo's longer side; corrected by the residuals."""

    max_error_percent: Positive = 0.3
    """Refuse a camera whose expected error on the surface is larger, percent of the longer side."""

    seed: Annotated[int, Field(ge=0)] = 0
    """Seed of the random sampling; the same seed gives the same camera."""


@dataclass(frozen=True, config=STRICT)
class StructureOptions:
    """How a camera is found by matching the mesh's structure, and when it is believed."""

    working_px: Annotated[int, Field(ge=128, le=4096)] = 768
    """Longer side of the reduced photo that is matched, pixels."""

    rolls_deg: tuple[float, ...] = (-14.0, -7.0, 0.0, 7.0, 14.0)
    """Turns about the line of sight that are tried around the start, degrees."""

    scales: tuple[Positive, ...] = (0.74, 0.86, 1.0, 1.16, 1.35)
    """Enlargements that are tried around the start."""

    starts: Annotated[int, Field(ge=0, le=100)] = 5
    """How many of the best turned, enlarged and shifted starts are followed up."""

    focal_sigma: Positive = 0.05
    """How far to trust the start's focal length: relative standard deviation."""

    k1_sigma: Annotated[float, Field(ge=0)] = 0.1
    """How far to trust the start's radial distortion k1: standard deviation; 0 = entirely. It is
    changed only where the photo leaves no doubt."""

    sure_support: Fraction = 0.75
    """Share of patches found in place at which no further start is tried."""

    confirmed_support: Fraction = 0.45
    """The same where two starts have led to the same place."""

    wider: bool = True
    """If the search around the start fails, search from other positions too."""

    min_support: Fraction = 0.33
    """Share of patches found in place, at half the working size, below which a camera is
    refused ..."""

    min_agreement: Fraction = 0.3
    """... unless that share at the working size is at least this."""

    min_coverage: Fraction = 0.4
    """Share of the picture that must agree, counted in cells where the mesh is."""

    far: Positive = 0.2
    """Image motion from the start, as a share of the width, from which on more is asked ..."""

    far_support: Fraction = 0.55
    """... namely this share of patches in place: what looks alike elsewhere has less."""

    max_error_percent: Positive = 0.5
    """Refuse a camera whose expected error on the surface is larger, percent of the longer side."""


MapName = Literal[
    "normal-x",
    "normal-y",
    "normal-z",
    "ao",
    "normal",
    "combined",
    "reflection",
    "reflection-combined",
    "silhouette",
]
"""What of the bare mesh is compared with a photo by mutual information."""


@dataclass(frozen=True, config=STRICT)
class MutualInformationOptions:
    """How a camera is moved until the rendered mesh tells most about the photo."""

    maps: tuple[MapName, ...] = ("normal-x", "normal-y", "ao", "silhouette")
    """Renderings that are compared; their information is added up. Normals (camera axes), ambient
    occlusion, both blended (combined), mirror directions, and inside against outside."""

    measure: Literal["mutual-information", "normalized"] = "mutual-information"
    """The plain measure, or the one that is divided by the joint entropy."""

    gradients: bool = False
    """Compare the strengths of gradients instead of the values."""

    bins: Annotated[int, Field(ge=4, le=256)] = 32
    """Steps into which gray and rendered values are divided."""

    working_px: Annotated[int, Field(ge=128, le=4096)] = 512
    """Longer side of the reduced photo at the finest level, pixels."""

    focal: bool = False
    """Solve the focal length too; the distance follows it, so that the size stays."""

    pick_sigma_percent: Positive = 0.07
    """Noise of picks, percent of the photo's longer side, where there are any: it decides how
    much they count beside the mutual information."""

    max_error_percent: Positive = 0.4
    """Refuse a camera whose expected error is larger, percent of the photo's width."""


@dataclass(frozen=True, config=STRICT)
class SilhouetteOptions:
    """How a camera is found from the object's outline, without any start if need be."""

    views: Annotated[int, Field(ge=20, le=5000)] = 500
    """Directions from which the mesh's outline is compared where there is no start."""

    followed: Annotated[int, Field(ge=1, le=200)] = 24
    """How many of the likeliest views are fitted coarsely."""

    hypotheses: Annotated[int, Field(ge=1, le=20)] = 5
    """How many of those, if they differ, are fitted finely and told apart by what is inside."""

    working_px: Annotated[int, Field(ge=64, le=2048)] = 320
    """Longer side of the reduced photo at the finest level, pixels."""

    max_xor: Fraction = 0.06
    """Area between the two outlines, as a share of the object's, above which a camera is
    refused."""

    rival: Annotated[float, Field(ge=1)] = 1.5
    """A camera from elsewhere is a rival if its area is smaller than this many times the best."""

    max_error_percent: Positive = 1.0
    """Refuse a camera whose expected error is larger, percent of the photo's width."""


@dataclass(frozen=True, config=STRICT)
class RefineOptions:
    """How the cameras of all photos are brought to agree with each other on the surface."""

    enabled: bool = True
    """Whether `run` refines; `texproj refine` always does."""

    working_px: Annotated[int, Field(ge=256, le=8192)] = 768
    """Longer side of the reduced photos that are compared, pixels; twice that at the end."""

    partners: Annotated[int, Field(ge=1, le=50)] = 6
    """With how many others each photo is compared."""

    rounds: Annotated[int, Field(ge=0, le=100)] = 8
    """Most rounds at the working size; it stops earlier when the cameras no longer move."""

    fine_rounds: Annotated[int, Field(ge=0, le=100)] = 2
    """Most rounds at twice the working size."""

    focal_sigma: Positive = 0.02
    """How far to trust the focal length that the photos of one lens have found on average:
    relative standard deviation."""

    least_support: Fraction = 0.15
    """A photo is thrown out if no partner confirms at least this share of its patches."""

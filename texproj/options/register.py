"""How cameras are found."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from texproj.options.base import EXPERT, STRICT, Positive


@dataclass(frozen=True, config=STRICT)
class RegisterOptions:
    """How the cameras of the photos are found."""

    method: Literal[
        "auto", "points", "mutual-information", "silhouette", "structure", "features", "block"
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


@dataclass(frozen=True, config=STRICT)
class StructureOptions:
    """How a camera is found by matching the mesh's structure, and when it is believed."""

    working_px: Annotated[int, Field(ge=128, le=4096)] = 768
    """Longer side of the reduced photo that is matched, pixels."""

    focal_sigma: Positive = 0.05
    """How far to trust the start's focal length: relative standard deviation."""

    k1_sigma: Annotated[float, Field(ge=0), EXPERT] = 0.1
    """How far to trust the start's radial distortion k1: standard deviation; 0 = entirely. It is
    changed only where the photo leaves no doubt."""

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

    measure: Annotated[Literal["mutual-information", "normalized"], EXPERT] = "mutual-information"
    """The plain measure, or the one that is divided by the joint entropy."""

    gradients: Annotated[bool, EXPERT] = False
    """Compare the strengths of gradients instead of the values."""

    working_px: Annotated[int, Field(ge=128, le=4096)] = 512
    """Longer side of the reduced photo at the finest level, pixels."""

    focal: bool = False
    """Solve the focal length too; the distance follows it, so that the size stays."""

    pick_sigma_percent: Annotated[Positive, EXPERT] = 0.07
    """Noise of picks, percent of the photo's longer side, where there are any: it decides how
    much they count beside the mutual information."""

    max_error_percent: Positive = 0.4
    """Refuse a camera whose expected error is larger, percent of the longer side."""


@dataclass(frozen=True, config=STRICT)
class SilhouetteOptions:
    """How a camera is found from the object's outline, without any start if need be."""

    views: Annotated[int, Field(ge=20, le=5000)] = 500
    """Directions from which the mesh's outline is compared where there is no start."""


@dataclass(frozen=True, config=STRICT)
class RefineOptions:
    """How the cameras of all photos are brought to agree with each other on the surface."""

    enabled: bool = True
    """Whether `run` refines; `texproj refine` always does."""

    hold: Literal["auto", "none", "picks", "imported"] = "auto"
    """What holds the photos' place on the mesh: nothing but the photos; picks, which move all
    photos together; imported cameras, which do not move. Auto: imported cameras in `run`, nothing
    in `refine`."""

    working_px: Annotated[int, Field(ge=128, le=8192), EXPERT] = 768
    """Longer side of the reduced photos that are compared, pixels; twice that at the end."""

    partners: Annotated[int, Field(ge=1, le=50), EXPERT] = 6
    """With how many others each photo is compared."""

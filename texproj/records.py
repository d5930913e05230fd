"""What is known of each photo's camera, and what a registration found: the nouns that travel
from registration to color.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from texproj.camera import Camera, Intrinsics, Pose

Status = Literal["registered", "prior", "failed"]
Method = Literal[
    "points", "mutual-information", "silhouette", "structure", "features", "block", "import"
]
THROUGH = "through"
"""Key of an entry's quality: the photos through which it was found, where it was."""
PROOF = "proofs"
"""Key of an entry's quality: what speaks for and against its camera."""
CHOSEN = "chosen_place"
"""Key of an entry's quality: the number of the place that somebody chose among several."""
DOUBTED = "not_borne_out"
"""Key of a registered entry's quality: other photos that overlap do not bear it out, so no photo is
sought through it."""


@dataclass(frozen=True, eq=False)
class CameraRecord:
    """One entry of cameras.json.

    intrinsics and pose may each be None: status "prior" can carry intrinsics alone, "failed"
    carries no pose. quality: numbers and words for the report; extra: keys of the file that
    others wrote, kept as they are.

    sought: texproj has sought this camera, and `start` is the one that it started from, if there
    was one; else somebody else has written the entry. refinement: where all photos were refined
    together since then, the way back.
    """

    file: str
    width: int
    height: int
    intrinsics: Intrinsics | None
    pose: Pose | None
    status: Status
    method: Method | None = None
    quality: dict[str, Any] = field(default_factory=dict)
    extra: dict[str, Any] = field(default_factory=dict)
    sought: bool = False
    start: CameraRecord | None = None
    refinement: Refinement | None = None

    @property
    def camera(self) -> Camera | None:
        """The full camera, if both halves are known."""
        if self.intrinsics is None or self.pose is None:
            return None
        return Camera(self.intrinsics, self.pose)

    @property
    def registered_camera(self) -> Camera | None:
        """The camera, if it is vouched for: what color may use."""
        return self.camera if self.status == "registered" else None

    @property
    def vouches(self) -> bool:
        """Whether other photos may be found through this one."""
        return self.registered_camera is not None and not self.quality.get(DOUBTED)

    @property
    def through(self) -> tuple[str, ...]:
        """The photos through which texproj found this camera; none if it stands on its own."""
        if not self.sought or self.method not in ("features", "block"):
            return ()
        names = self.quality.get(THROUGH)
        return tuple(n for n in names if isinstance(n, str)) if isinstance(names, list) else ()


@dataclass(frozen=True, eq=False)
class Refinement:
    """What the joint refinement leaves beside the camera that it made.

    own: the photo's own registration before it; camera: hash of the camera that it made, by which
    a later edit of that by hand shows; asked: it was refined on request, while the settings had
    it switched off.
    """

    own: CameraRecord
    camera: str
    asked: bool


@dataclass(frozen=True, eq=False)
class Fit:
    """The outcome of one registration that ended with a camera.

    camera: for the full-size photo; method: how; expected_error_px: one standard deviation of
    the image position of the surface, full-size pixels, from the fit's covariance;
    residual_px: (n,) reprojection errors of what was matched, full-size pixels;
    inliers: (n,) bool; names: (n,) labels of the residuals (picks) or empty;
    covariance: (p, p) of the solved parameters (rotation rad, translation mesh units, then the
    intrinsics named in `solved`); accepted: the verdict; reason: one sentence for people, why
    it was refused or what to mind; quality: further numbers for the report.
    """

    camera: Camera
    method: Method
    expected_error_px: float
    residual_px: NDArray[np.float64]
    inliers: NDArray[np.bool_]
    covariance: NDArray[np.float64]
    solved: tuple[str, ...] = ("rotation", "translation")
    names: tuple[str, ...] = ()
    accepted: bool = True
    reason: str = ""
    quality: dict[str, Any] = field(default_factory=dict)

"""What a joint refinement ends in: cameras, and how sure they are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from texproj.arrays import Bools, Doubles
from texproj.camera import Camera
from texproj.register.joint.frame import (
    Certainty,
    Similarity,
    certainty,
    common_similarity,
    frame_px,
)
from texproj.register.joint.holding import Picks, held_by_picks
from texproj.register.joint.session import Cameras
from texproj.solve.joint_covariance import JointCovariance
from texproj.solve.lm import LmFit
from texproj.solve.shared_lens import LensParameters

TIE_CORRELATION = 20.0
"""How many ties share an error (shape of the mesh, light); widens the expected error."""
LEAST_SCATTER = 0.1
"""Of the ties' variance factor: photos that agree better than that agree by the same errors."""
AGREEMENT_PX, FRAME_PX, MEASURED_AT_PX = 0.055, 0.22, 768
"""What more ties do not remove, pixels of the surface in photos reduced to the third: of one photo
against the others, and of all together against the mesh, whose errors they take for its place. Of
five real scenes with known cameras: .05 to .1, and .16 to .4."""


@dataclass(frozen=True, eq=False)
class Refined:
    """Cameras that were brought to agree with each other on the surface.

    cameras: full size, as given where nothing could be said; thrown_out: why, by number, for
    those that contradict the others; tied: numbers of those that were solved;
    expected_error_px, motion_px: (n,) full-size pixels, NaN where not solved; quality: for the
    report; found_again: numbers of those that contradicted the others and were found by them.
    """

    cameras: Cameras
    thrown_out: dict[int, str]
    tied: tuple[int, ...]
    expected_error_px: Doubles
    motion_px: Doubles
    quality: dict[str, Any] = field(default_factory=dict)
    found_again: tuple[int, ...] = ()

    def among(self, kept: Sequence[int], given: Cameras, why: Mapping[int, str]) -> Refined:
        """This as the result of the photos `kept` of all; why: the others contradict them."""
        cameras, nothing = list(given), np.full(len(given), np.nan)
        error, motion = nothing.copy(), nothing.copy()
        for position, k in enumerate(kept):
            cameras[k] = self.cameras[position]
            error[k], motion[k] = self.expected_error_px[position], self.motion_px[position]
        thrown_out = {**why, **{kept[k]: reason for k, reason in self.thrown_out.items()}}
        tied, again = (tuple(kept[k] for k in some) for some in (self.tied, self.found_again))
        return Refined(tuple(cameras), thrown_out, tied, error, motion, self.quality, again)


@dataclass(frozen=True, eq=False)
class Solved:
    """The last fit and what it was made of. given, cameras: before and after; points: of each photo
    (n, 3) world points in its view; fixed: (n,) cameras that must not move; picks: by number, those
    that hold the frame.
    """

    given: Cameras
    cameras: Cameras
    tied: tuple[int, ...]
    points: Sequence[Doubles]
    fixed: Bools
    lenses: LensParameters
    fit: LmFit[Cameras]
    picks: Mapping[int, Picks]

    def outcome(self) -> Refined:
        """The cameras in their frame, with their expected errors."""
        taking_part = np.isin(np.arange(len(self.given)), self.tied)
        seen = [p if t else p[:0] for p, t in zip(self.points, taking_part, strict=True)]
        factor = max(self.fit.scatter2, LEAST_SCATTER) * TIE_CORRELATION
        covariance = JointCovariance.of(self.fit, factor, len(self.cameras))
        sure = certainty(self.cameras, seen, self.lenses, taking_part & ~self.fixed, covariance)
        cameras, frame = self._in_frame(sure, seen, taking_part)
        by_frame = frame_px(cameras, seen, sure.center, frame)
        systematic = AGREEMENT_PX * self._reduction
        agreement = np.where(self.fixed, 0.0, np.hypot(sure.agreement_px, systematic))
        error = np.where(
            taking_part, np.where(self.fixed, 0, np.hypot(agreement, by_frame)), np.nan
        )
        moved = common_similarity(self._of(self.given), self._of(cameras),
                                  [seen[k] for k in self.tied], sure.center)  # fmt: skip
        motion = np.array([
            np.nanmean(np.linalg.norm(b.project(p)[0] - a.project(p)[0], axis=1))
            if len(p) else np.nan for a, b, p in zip(self.given, cameras, seen, strict=True)
        ])  # fmt: skip
        solved = taking_part & ~self.fixed
        quality = {
            "focal_px": [round(c.intrinsics.fx, 2) for c in cameras],
            "ties": len(self.fit.residual),
            "agreement": {"expected_px": _median(agreement[solved])},
            "frame": {
                "held_by": self._held_by,
                "expected_px": _median(by_frame[solved]),
                **_told(moved, frame),
            },
        }
        error = np.where(taking_part, error, np.nan)
        return Refined(cameras, {}, self.tied, error, motion, quality)

    @property
    def _reduction(self) -> Doubles:
        """(n,) full-size pixels per pixel at the size at which errors were measured."""
        longest = np.array([max(camera.width, camera.height) for camera in self.given])
        return np.maximum(longest / MEASURED_AT_PX, 1.0)

    @property
    def _held_by(self) -> str:
        if self.fixed.any():
            return "cameras that do not move"
        return "picks" if self.picks else "the mesh, as the photos show it"

    def _in_frame(
        self, sure: Certainty, seen: Sequence[Doubles], taking_part: Bools
    ) -> tuple[Cameras, Doubles]:
        """The cameras where their frame is held, and its (7, 7) covariance."""
        frame, fixed = sure.frame, self.fixed.any()
        if fixed or not np.isfinite(frame).all():
            return self.cameras, frame
        statistical = frame_px(self.cameras, seen, sure.center, frame)[taking_part]
        systematic = (FRAME_PX * self._reduction)[taking_part]
        frame = frame * (1 + np.median(systematic / np.maximum(statistical, 1e-9)) ** 2)
        picks = {k: one for k, one in self.picks.items() if taking_part[k]}
        if not picks:
            return self.cameras, frame
        motion, frame = held_by_picks(dict(enumerate(self.cameras)), picks, sure.center, frame)
        return tuple(
            Camera(c.intrinsics, motion.moved(c.pose)) if part else c
            for c, part in zip(self.cameras, taking_part, strict=True)
        ), frame

    def _of(self, cameras: Cameras) -> list[Camera]:
        return [cameras[k] for k in self.tied]


def _median(values: Doubles) -> float | None:
    finite = values[np.isfinite(values)]
    return round(float(np.median(finite)), 3) if len(finite) else None


def _told(moved: Similarity, frame: Doubles) -> dict[str, Any]:
    """The seven numbers of the motion of all cameras together, with standard deviations: None where
    nothing is known.
    """
    sigma = np.sqrt(np.maximum(np.diag(frame), 0)) if np.isfinite(frame).all() else [None] * 7

    def told(values: Any, factor: float = 1.0) -> Any:
        return [None if v is None else float(f"{factor * v:.4g}") for v in values]

    return {
        "center": told(moved.center),
        "scale_percent": told([100 * np.expm1(moved.log_scale)])[0],
        "scale_sigma_percent": told(sigma[:1], 100)[0],
        "rotation_deg": told(np.degrees(moved.rotation)),
        "rotation_sigma_deg": told(sigma[1:4], 180 / np.pi),
        "shift": told(moved.shift),
        "shift_sigma": told(sigma[4:]),
    }

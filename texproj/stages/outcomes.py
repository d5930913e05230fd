"""What became of each photo's registration: its entry of cameras.json, and what to tell of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from texproj.errors import InputError
from texproj.project import Project
from texproj.records import CameraRecord, Fit
from texproj.stages.attending import attended

UNUSABLE = "unusable_input"
"""Key of an entry's quality: a file of the photo cannot be read, so nothing else is tried."""
CONTRADICTED = "is that one's camera right?"
"""Ends what is said of a single registered photo that the mesh's edges contradict."""


@dataclass(frozen=True)
class Tally:
    """How many of how many photos could not be `verb`; unusable: why there is no result at all;
    fault: what a stage could not do for all photos together, though there is a result.
    """

    failed: int
    total: int
    verb: str
    unusable: str = ""
    fault: str = ""


@dataclass(frozen=True, eq=False)
class PhotoOutcome:
    """What became of one photo: its entry, whether it was done now or kept, and why."""

    name: str
    record: CameraRecord
    kept: bool
    reason: str

    @property
    def failed(self) -> bool:
        return self.record.status == "failed"

    @property
    def may_be_helped(self) -> bool:
        """Whether other photos could find what its own means did not."""
        return self.failed and not self.record.quality.get(UNUSABLE)

    def lines(self) -> list[str]:
        """For people."""
        if self.failed:
            return [f"{self.name}: FAILED: {self.reason}"]
        error = self.record.quality.get("expected_error_px")
        accuracy = f", expected error {error:.1f} px" if error is not None else ""
        note = f" ({self.reason})" if self.reason else ""
        kept = "fresh, " if self.kept else ""
        return [f"{self.name}: {kept}{self.record.status} by {self.record.method}{accuracy}{note}"]

    def as_dict(self) -> dict[str, Any]:
        """For --json."""
        return {
            "file": self.name,
            "status": self.record.status,
            "method": self.record.method,
            "kept": self.kept,
            "reason": self.reason,
            "quality": self.record.quality,
        }


@dataclass(frozen=True, eq=False)
class RegisterOutcome:
    """What became of several photos; question: what somebody has to choose, empty if nothing."""

    photos: Sequence[PhotoOutcome]
    question: str = ""

    @property
    def tally(self) -> Tally:
        failed = sum(photo.failed for photo in self.photos)
        return Tally(failed, len(self.photos), "registered")

    def lines(self) -> list[str]:
        """For people."""
        told = [line for photo in self.photos for line in photo.lines()]
        return [*told, self.question] if self.question else told

    def as_dict(self) -> dict[str, Any]:
        """For --json."""
        photos = [photo.as_dict() for photo in self.photos]
        return {"photos": photos, "question": self.question}


def registered_record(_: Project, name: str, start: CameraRecord | None, fit: Fit) -> CameraRecord:
    """The entry of a photo whose camera was found."""
    camera = fit.camera
    return CameraRecord(
        file=name, width=camera.width, height=camera.height,
        intrinsics=camera.intrinsics, pose=camera.pose,
        status="registered", method=fit.method,
        quality=fit_quality(fit), sought=True, start=start,
    )  # fmt: skip


def failed_record(
    project: Project, name: str, start: CameraRecord | None, quality: dict[str, Any]
) -> CameraRecord:
    """The entry of a photo whose camera was not found; quality says why."""
    intrinsics = start.intrinsics if start else None
    width, height = _size(project, name, start)
    return CameraRecord(
        name, width, height, intrinsics, None, "failed", None, quality, sought=True, start=start
    )


def refused_record(
    project: Project, name: str, start: CameraRecord | None, fit: Fit
) -> CameraRecord:
    """The entry of a photo whose fit is not believed."""
    record = failed_record(project, name, start, fit_quality(fit))
    return replace(record, method=fit.method)


def _size(project: Project, name: str, start: CameraRecord | None) -> tuple[int, int]:
    if start is not None:
        return start.width, start.height
    try:
        info = attended(name, lambda: project.photo_info(name))
    except InputError:  # an unreadable photo has no size; its entry says why it failed
        return 1, 1
    return info.width, info.height


def fit_quality(fit: Fit) -> dict[str, Any]:
    """The numbers of a fit for cameras.json and the report; None for one that is not finite."""
    inlying = fit.residual_px[fit.inliers]
    quality: dict[str, Any] = {
        "expected_error_px": round(float(fit.expected_error_px), 3),
        "median_residual_px": round(float(np.median(inlying)), 3) if len(inlying) else None,
        "matches": len(fit.residual_px),
        "inliers": int(fit.inliers.sum()),
        "solved": list(fit.solved),
        "reason": fit.reason,
        **fit.quality,
    }
    if fit.names:
        rows = zip(fit.names, fit.residual_px, fit.inliers, strict=True)
        quality["picks"] = [
            {"name": n, "residual_px": round(float(r), 3), "outlier": not bool(ok)}
            for n, r, ok in rows
        ]
    return {key: _finite(value) for key, value in quality.items()}


def _finite(value: Any) -> Any:
    """A value of a fit's quality as JSON can hold it."""
    if isinstance(value, float | np.floating) and not math.isfinite(value):
        return None
    return value

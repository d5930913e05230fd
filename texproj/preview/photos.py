"""What the page says about each photo, and the photo itself as a picture for the browser."""

from __future__ import annotations

import contextlib
import threading
from typing import Any

import numpy as np

from texproj.camera import Camera
from texproj.errors import TexprojError
from texproj.formats.jpeg import jpeg_bytes
from texproj.photo import Photo
from texproj.preview.door import OUTSIDE, leaves
from texproj.project import Project
from texproj.records import CameraRecord

JPEG_QUALITY = 92
MOST_KEPT_BYTES = 256 << 20
"""Pictures kept in memory: the small ones of thousands of photos, the large ones of some 30."""

SIZES = (240, 1600, 8192)
"""Longer sides in pixels that pictures are made in: list, overview, picking."""

WEAK_PX = 2.0
"""Expected error in full-size pixels above which a registration is shown with a warning."""

MIN_PICKS = 8
"""What registers a photo of an unknown lens; 4 are enough only where the lens is known."""
ADVISED = f"pick {MIN_PICKS} points"
"""A reason that says so needs no advice."""


def photo_facts(project: Project, name: str, record: CameraRecord | None) -> dict[str, Any]:
    """Everything that the page knows about a photo; nothing here reads its pixels."""
    facts: dict[str, Any] = {"name": name, "status": "none", "advice": "", "picks": 0}
    try:
        info = project.photo_info(name)
        facts |= {"width": info.width, "height": info.height, "notes": list(info.notes)}
    except TexprojError as error:
        return facts | {"status": "broken", "reason": str(error), "advice": BROKEN_ADVICE}
    if leaves(project.correspondences_path(name), project.root):
        return facts | {"status": "failed", "picks_error": f"Its picks are not read: {OUTSIDE}"}
    try:
        picks = project.load_correspondences(name)
        facts["picks"] = len(picks) if picks is not None else 0
    except TexprojError as error:
        facts["picks_error"] = str(error)
    with contextlib.suppress(TexprojError):  # two masks: told when the photo is used
        facts["mask"] = project.mask_path(name) is not None
    if record is None:
        return facts | {"reason": "not registered yet", "advice": start_advice(facts["picks"])}
    return facts | record_facts(record, facts["picks"])


def record_facts(record: CameraRecord, picks: int) -> dict[str, Any]:
    """What cameras.json says about a photo, and what to do about it."""
    quality = record.quality
    error = quality.get("expected_error_px")
    error = float(error) if isinstance(error, int | float) else None
    weak = record.status == "registered" and error is not None and error > WEAK_PX
    facts: dict[str, Any] = {
        "status": record.status,
        "method": record.method,
        "expected_error_px": error,
        "weak": weak,
        "reason": str(quality.get("reason") or ""),
        "quality": {k: v for k, v in quality.items() if isinstance(v, int | float | str)},
    }
    if record.camera is not None:
        facts["camera"] = camera_facts(record.camera)
    if record.status == "failed" or weak:
        told = picks == 0 and ADVISED in facts["reason"]
        facts["advice"] = "" if told else start_advice(picks)
    elif record.status == "prior":
        facts["reason"] = facts["reason"] or "an approximate camera, not registered yet"
        facts["advice"] = f"Make the model, or pick {MIN_PICKS} points."
    return facts


def camera_facts(camera: Camera) -> dict[str, Any]:
    """A camera as the page computes with it."""
    k, pose = camera.intrinsics, camera.pose
    radius = k.max_radius
    return {
        "width": k.width,
        "height": k.height,
        "f": [k.fx, k.fy],
        "c": [k.cx, k.cy],
        "dist": list(k.dist),
        "model": k.model,
        "max_radius": radius if np.isfinite(radius) else None,
        "R": pose.R.tolist(),
        "t": pose.t.tolist(),
    }


def start_advice(picks: int) -> str:
    """What helps a photo that has no good camera."""
    missing = MIN_PICKS - picks
    if missing > 0:
        return f"Pick {missing} {'more ' if picks else ''}point{'s' if missing > 1 else ''}."
    return "Check the picks: spread them over the whole photo, then solve."


THUMBNAIL_PX = 240
"""Size of the pictures in lists."""
BROKEN_ADVICE = "Replace the file with an intact one, or take it out of the photo folder."


class Pictures:
    """Photos as JPEG, the latest of them kept in memory: who only looks writes nothing to disk."""

    def __init__(self) -> None:
        self._kept: dict[tuple[str, int, str], bytes] = {}
        self._bytes = 0
        self._lock = threading.Lock()

    def jpeg(self, project: Project, name: str, size: int) -> bytes:
        """A photo in sRGB, longer side at most `size`. Raises TexprojError."""
        stat = project.photo_path(name).stat()
        key = (name, size, f"{stat.st_mtime_ns}-{stat.st_size}")
        with self._lock:
            known = self._kept.pop(key, None)
            if known is not None:
                self._kept[key] = known
                return known
        load = project.load_thumbnail if size <= THUMBNAIL_PX else project.load_photo
        data = encode_jpeg(load(name, size))
        with self._lock:
            self._keep(key, data)
        return data

    def _keep(self, key: tuple[str, int, str], data: bytes) -> None:
        if key not in self._kept:
            self._bytes += len(data)
        self._kept[key] = data
        while self._bytes > MOST_KEPT_BYTES:
            self._bytes -= len(self._kept.pop(next(iter(self._kept))))


def encode_jpeg(photo: Photo) -> bytes:
    """A photo as JPEG in sRGB."""
    return jpeg_bytes(photo.srgb8(), JPEG_QUALITY)

"""What registration and refinement leave in an entry of cameras.json beside the camera: where it
started, and what it was before all were refined together.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from texproj.files import json_hash
from texproj.formats.cameras import camera_part
from texproj.records import CameraRecord, Refinement

Entries = Mapping[str, CameraRecord]


UNKNOWN_ERROR_PERCENT = 0.1
"""Expected error of a camera that does not tell its own, percent of the photo's longer side."""


def start_of(entry: CameraRecord | None) -> CameraRecord | None:
    """The camera that the registration of an entry starts from: what was there before it."""
    if entry is None or not entry.sought:
        return entry
    if entry.status == "prior":  # somebody has put a camera in place of a failure
        return replace(entry, sought=False, start=None, refinement=None)
    return entry.start


def own_registration(entry: CameraRecord) -> CameraRecord:
    """The entry as the photo's own registration left it, before all were refined together.

    What others have written into it since then stays; a camera that somebody has changed since
    then counts as the photo's own.
    """
    if entry.refinement is None or not is_refined(entry):
        return replace(entry, refinement=None)
    return replace(entry.refinement.own, extra=entry.extra)


def is_refined(entry: CameraRecord) -> bool:
    """Whether the entry holds what the joint refinement made of it, unchanged since then."""
    return entry.refinement is not None and entry.refinement.camera == camera_hash(entry)


def refined_entry(record: CameraRecord, own: CameraRecord, asked: bool) -> CameraRecord:
    """The entry `record` with the way back to the photo's own registration.

    asked: it was refined on request, while the settings had it switched off.
    """
    return replace(record, refinement=Refinement(own, camera_hash(record), asked))


def camera_hash(entry: CameraRecord) -> str:
    """Hash of the camera alone, so that a later edit of it by hand shows."""
    return json_hash([*camera_part(entry).values(), entry.status])


def expected_error_px(record: CameraRecord) -> float:
    """What is known of the error of an entry's camera, full-size pixels, or what is usual."""
    unknown = UNKNOWN_ERROR_PERCENT / 100 * max(record.width, record.height)
    return float(record.quality.get("expected_error_px") or unknown)

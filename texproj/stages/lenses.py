"""Which photos were taken through the same lens."""

from __future__ import annotations

from texproj.project import Project
from texproj.records import CameraRecord


def lens_of(project: Project, name: str, start: CameraRecord | None) -> str:
    """What the photos taken through the same lens at the same zoom have in common.

    start: what is known of the photo's camera beforehand. Raises InputError for a photo that cannot
    be read.
    """
    if start is not None and start.intrinsics is not None:
        return repr(start.intrinsics)
    info = project.photo_info(name)
    longer, shorter = max(info.width, info.height), min(info.width, info.height)
    return repr((info.camera_body, longer, shorter, info.focal_px))

"""How a camera of another program's file may be meant for a photo as it is here: of the upright
picture or of the stored one, of this size or of another.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

from texproj.camera import Camera
from texproj.errors import InputError
from texproj.formats.interchange import ForeignCamera, upright
from texproj.photo import PhotoInfo

Turn = Literal["upright", "stored"]

NEAR_SIZE = 1.25
"""Nobody reduces photos by less than this; pictures made free of distortion differ by so little."""
STORED = "turned upright as EXIF says: the program had the stored picture"
UPRIGHT = "EXIF turns this photo: its camera is taken as one of the upright picture"


@dataclass(frozen=True, eq=False)
class Reading:
    """camera: for the upright photo at full size; note: what was assumed; other_picture: why the
    camera may be one of another picture than the photo; start_only: why it can be no more than a
    start; both are empty where nothing says so.
    """

    camera: Camera
    note: str
    other_picture: str = ""
    start_only: str = ""


@dataclass(frozen=True, eq=False)
class Readings:
    """What a camera may mean, by which picture the program had; told: what the file itself says
    of that, None where it does not.
    """

    of: Mapping[Turn, Reading]
    told: Turn | None = None

    @property
    def doubtful(self) -> bool:
        """Whether both pictures have the camera's shape."""
        return len(self.of) > 1

    def best(self, practice: Turn) -> Reading:
        """The reading for what the program did, or the only one."""
        return self.of[practice] if practice in self.of else next(iter(self.of.values()))


def with_known_focal(told: ForeignCamera, info: PhotoInfo) -> ForeignCamera:
    """The camera with EXIF's focal length in place of a nominal one."""
    if told.focal_told or info.focal_px is None:
        return told
    k = told.camera.intrinsics
    f = info.focal_px * max(k.width, k.height) / max(info.width, info.height)
    return replace(told, camera=replace(told.camera, intrinsics=replace(k, fx=f, fy=f)))


def readings(told: ForeignCamera, stored: ForeignCamera | None, info: PhotoInfo) -> Readings:
    """All that the camera may mean for a photo.

    told: as read with the upright photo's size for files that tell none; stored: as read with the
    size of the stored picture. Raises InputError where the shapes differ.
    """
    found: dict[Turn, Reading] = {}
    if _same_shape(told.camera, info.width, info.height):
        found["upright"] = _sized(told, told.camera, info, UPRIGHT if info.orientation != 1 else "")
    turned = _turned(stored or told, info)
    if turned is not None:
        found["stored"] = _sized(told, turned, info, STORED)
    if not found:
        size = f"{told.camera.width} x {told.camera.height}"
        raise InputError(
            f"its camera is for {size} pixels, the photo has {info.width} x {info.height}"
        )
    return Readings(found, _told(told, info, found))


def _turned(stored: ForeignCamera, info: PhotoInfo) -> Camera | None:
    """The camera of the stored picture turned upright; None if it cannot be one."""
    if info.orientation == 1:
        return None
    turned = upright(stored.camera, info.orientation)
    if turned is None or not _same_shape(turned, info.width, info.height):
        return None
    return turned


def _told(told: ForeignCamera, info: PhotoInfo, found: Mapping[Turn, Reading]) -> Turn | None:
    if info.orientation == 1:
        return None
    if len(found) == 1:
        return next(iter(found))
    if told.orientation is None:
        return None
    return "stored" if told.orientation == info.orientation else "upright"


def _sized(told: ForeignCamera, camera: Camera, info: PhotoInfo, note: str) -> Reading:
    """The camera for the photo's own size."""
    notes = [note]
    other = ""
    if (camera.width, camera.height) != (info.width, info.height):
        before = f"{camera.width} x {camera.height}"
        after = f"{info.width} x {info.height}"
        notes.append(f"rescaled from {before} to {after} pixels")
        ratio = info.width / camera.width
        if not camera.intrinsics.distorted or 1 / NEAR_SIZE < ratio < NEAR_SIZE:
            other = (
                f"its camera is for {before} pixels, the photo has {after}: was it made for"
                " pictures free of distortion? Then put those into photos/"
            )
        camera = camera.resized(info.width, info.height)
    said = "; ".join(filter(None, [*notes, *told.notes]))
    return Reading(camera, said, other, told.start_only)


def _same_shape(camera: Camera, width: int, height: int) -> bool:
    """Whether the picture is the camera's but for scale; a pixel of either for rounding."""
    scale = width / camera.width
    return abs(camera.height * scale - height) <= max(1.0, scale)

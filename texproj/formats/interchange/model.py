"""What a camera file of another program says, in our conventions, and what we write for one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from texproj.camera import Camera, Intrinsics, LensModel, Pose
from texproj.errors import InputError
from texproj.formats.camera_bounds import (
    checked_intrinsics,
    checked_rotation,
    checked_translation,
)

Array = NDArray[np.float64]
T = TypeVar("T")

SizeOf = Callable[[str], tuple[int, int] | None]
"""Width and height of the photo that a file names; None for a photo that is not at hand."""

Y_AND_Z_FLIPPED = np.diag([1.0, -1.0, -1.0])
"""Between OpenCV's camera axes (y down, z forward) and OpenGL's (y up, z backward)."""

LARGEST = 1e30
"""Size beyond which a number means nothing in a camera's file, whatever it is for."""

NOMINAL_FOCAL = 1.0
"""Focal length over the longer side where nothing tells it: 36 mm of a full-frame camera."""

NO_LENS = "the file tells no whole lens: its camera is taken as a start"

CLEAN_ROTATION = 1e-12
"""Rotations as exact as this keep every bit."""


@dataclass(frozen=True, eq=False)
class ForeignCamera:
    """The camera of the photo that the file calls `name`, maybe with folders, maybe without
    an ending; notes: what was lost or assumed, one sentence each; orientation: EXIF's number as
    the file tells it, None where it does not: 1 if the picture was upright to the program, another
    if the camera is of the stored picture, which lies. start_only: why the camera can be no more
    than a start, empty where the file tells all of it; focal_told: False where the focal length is
    a nominal one, for which the photo's own EXIF is the better guess.
    """

    name: str
    camera: Camera
    notes: tuple[str, ...] = ()
    orientation: int | None = None
    start_only: str = ""
    focal_told: bool = True


@dataclass(frozen=True, eq=False)
class ForeignModel:
    """All that a file tells. refused: photos without a camera that we can use, and why;
    absent: photos that cannot be looked up because the file tells no size of its own.
    """

    cameras: tuple[ForeignCamera, ...]
    refused: dict[str, str] = field(default_factory=dict)
    absent: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Shot:
    """A photo to be written: its file name, its path as seen from the new file, its camera."""

    name: str
    path: str
    camera: Camera


@dataclass(frozen=True, eq=False)
class Written:
    """Contents of the new files by name, and by photo what the format could not express."""

    files: dict[str, bytes]
    notes: dict[str, str] = field(default_factory=dict)

    @classmethod
    def of(
        cls, files: dict[str, bytes], shots: Iterable[Shot], lost: Callable[[Intrinsics], str]
    ) -> Written:
        """With a note for each photo of whose lens something is lost, in the words of `lost`."""
        told = {shot.name: lost(shot.camera.intrinsics) for shot in shots}
        return cls(files, {name: note for name, note in told.items() if note})


class Unusable(Exception):  # noqa: N818 - turned into an entry of `refused`
    """A camera that cannot be brought to our model; the text says why."""


def pose_at(R: ArrayLike, center: ArrayLike) -> Pose:
    """The pose with rotation `R` (cam_from_world) whose projection center is `center`, world.

    Raises Unusable for a center that lies beyond all measure.
    """
    R = np.asarray(R, np.float64)
    return Pose(R, -R @ possible(checked_translation, center, "its pose", "center"))


def rotation(values: ArrayLike, where: str) -> Array:
    """(3, 3) rotation next to `values` as printed. Raises InputError if they are none."""
    R = checked_rotation(values, where)
    if np.abs(R @ R.T - np.eye(3)).max() < CLEAN_ROTATION:
        return R
    u, _, vt = np.linalg.svd(R)
    return np.asarray(u @ vt)


def numbers(given: Any, count: int, where: str) -> Array:
    """(count,) finite numbers of a text or list. Raises InputError that names `where`."""
    words = given.split() if isinstance(given, str) else given
    listed = isinstance(words, list | tuple | np.ndarray) and len(words) == count
    try:
        values = np.array([float(word) for word in words if not isinstance(word, bool)])
    except (TypeError, ValueError, OverflowError):
        listed = False
    if not listed or len(values) != count or not np.isfinite(values).all():
        raise InputError(f"{where}: {count} numbers expected")
    if np.abs(values).max(initial=0) > LARGEST:
        raise InputError(f"{where}: a number beyond {LARGEST:g} is none of a camera's")
    return values


def number(value: Any, where: str) -> float:
    """One finite number. Raises InputError that names `where`."""
    return float(numbers([value], 1, where)[0])


def words(values: Iterable[float]) -> str:
    """Numbers as text that gives back every bit."""
    return " ".join(repr(float(value)) for value in values)


def lens(
    width: float, height: float, f: ArrayLike, c: ArrayLike, dist: ArrayLike = (0.0,) * 5,
    model: LensModel = "perspective",
) -> Intrinsics:  # fmt: skip
    """Intrinsics of focal lengths (1 or 2) and principal point, pixels from the image corner.

    Raises Unusable for values that no camera has.
    """
    return possible(checked_intrinsics, width, height, f, c, dist, "its lens", model)


def unknown_lens(name: str, size: tuple[int, int], pose: Pose) -> ForeignCamera:
    """The camera of a file that tells a pose and no lens: a start, with a nominal focal length."""
    center = size[0] / 2, size[1] / 2
    intrinsics = lens(*size, NOMINAL_FOCAL * max(size), center)
    return ForeignCamera(name, Camera(intrinsics, pose), start_only=NO_LENS, focal_told=False)


def possible(check: Callable[..., T], *values: Any) -> T:
    """What `check` makes of the values; Unusable for those that no camera has, so that one photo's
    camera stops no other.
    """
    try:
        return check(*values)
    except InputError as error:
        raise Unusable(str(error)) from None


def five(dist: Sequence[float]) -> tuple[float, float, float, float, float]:
    """k1 k2 p1 p2 k3 of an OpenCV distortion of any length."""
    k1, k2, p1, p2, k3 = (*dist, *(0.0,) * 5)[:5]
    return k1, k2, p1, p2, k3


def brown_terms(k: Intrinsics) -> dict[str, float]:
    """k1 k2 p1 p2 k3 of a lens by name."""
    return dict(zip(("k1", "k2", "p1", "p2", "k3"), five(k.dist), strict=True))


def beyond_k3(k: Intrinsics) -> dict[str, float]:
    """The further terms of a lens by name, which few formats have a place for."""
    return {f"dist[{i}]": v for i, v in enumerate(k.dist) if i > (3 if k.is_fisheye else 4)}


def fisheye_terms(k: Intrinsics) -> dict[str, float]:
    """k1 k2 k3 k4 of a fisheye by name: OpenCV's own."""
    return dict(zip(("k1", "k2", "k3", "k4"), k.dist, strict=False))


def left_out(terms: Mapping[str, float], threshold: float = 0.0) -> str:
    """A sentence about terms that a format has no place for; empty if none matters."""
    lost = [f"{name} = {value:.6g}" for name, value in terms.items() if abs(value) > threshold]
    return f"the format has no place for {', '.join(lost)}" if lost else ""


def sentences(parts: Iterable[str]) -> str:
    """The parts that say something, joined."""
    return "; ".join(part for part in parts if part)


def lenses_of(shots: Iterable[Shot]) -> list[Intrinsics]:
    """Each lens once: photos of the same one share it."""
    return list(dict.fromkeys(shot.camera.intrinsics for shot in shots))

"""texrecon's .cam files (mvs-texturing; MVE's camera): one beside each photo, in a folder.

First line: translation and rotation by rows, cam_from_world with OpenCV's axes. Second: focal
length, two distortions, pixel aspect, principal point; what is left out is 0 0 1 0.5 0.5. The focal
length is in units of the picture's longer side (of square pixels), the principal point in widths
and heights from the corner (libs/mve/camera.cc, fill_projection; generate_texture_views.cpp).
Distortions turn about the picture's middle: both as Bundler's k1 and k2, the first alone as
VisualSFM's of measurements (libs/mve/image_tools.h).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path, PurePosixPath

import numpy as np

from texproj.camera import Camera, Intrinsics, Pose
from texproj.errors import InputError
from texproj.formats.camera_bounds import checked_translation
from texproj.formats.documents import read_text
from texproj.formats.interchange.model import (
    Array,
    ForeignCamera,
    ForeignModel,
    Shot,
    SizeOf,
    Unusable,
    Written,
    beyond_k3,
    five,
    left_out,
    lens,
    numbers,
    possible,
    rotation,
    sentences,
    words,
)
from texproj.formats.interchange.radial import of_measurements

LENS = (1.0, 0.0, 0.0, 1.0, 0.5, 0.5)
"""Focal length, distortions, pixel aspect, principal point where a line leaves them out."""
NEVER_ZERO = 1e-30
"""In place of a second distortion of zero: a zero would make the first one of measurements."""


def read_texrecon(path: Path, size_of: SizeOf) -> ForeignModel:
    """The .cam files in folder `path`; sizes are the photos'. Raises InputError."""
    files = sorted(path.glob("*.cam"))
    if not files:
        raise InputError(f"{path}: no .cam file in the folder")
    found, refused, absent = [], {}, []
    for file in files:
        pose, inner = _lines(file)
        size = size_of(file.stem)
        if size is None:
            absent.append(file.stem)
            continue
        try:
            found.append(_camera(file, pose, inner, size))
        except Unusable as reason:
            refused[file.stem] = str(reason)
    return ForeignModel(tuple(found), refused, tuple(absent))


def write_texrecon(shots: Sequence[Shot]) -> Written:
    """One file a photo, to lie beside it. k1 and k2 go with a centered principal point alone."""
    files = {f"{PurePosixPath(shot.name).stem}.cam": _text(shot.camera).encode() for shot in shots}
    return Written.of(files, shots, _lost)


def _lines(file: Path) -> tuple[Array, Array]:
    """(12,) translation and rotation, (6,) lens."""
    lines = [line for line in read_text(file).split("\n") if line.strip()]
    if len(lines) < 2:
        raise InputError(f"{file}: two lines expected (translation and rotation; lens)")
    given = lines[1].split()
    if not 1 <= len(given) <= len(LENS):
        raise InputError(f"{file}, line 2: 1 to {len(LENS)} numbers expected")
    inner = np.array(LENS)
    inner[: len(given)] = numbers(given, len(given), f"{file}, line 2")
    return numbers(lines[0], 12, f"{file}, line 1"), inner


def _camera(file: Path, pose: Array, inner: Array, size: tuple[int, int]) -> ForeignCamera:
    f, d0, d1, aspect, px, py = inner
    width, height = size
    if not 1e-3 < aspect < 1e3:
        raise Unusable(f"its pixels have an aspect of {aspect:g}")
    across = width if width * aspect >= height else height / aspect
    focal, center = (f * across, f * across * aspect), (px * width, py * height)
    if (d0 or d1) and (px, py) != (0.5, 0.5):
        raise Unusable(
            "its distortion turns about the middle, its principal point lies elsewhere; use the"
            " photos without distortion"
        )
    k1, k2 = (d0, d1) if d1 else (0.0, 0.0)
    intrinsics, note = lens(width, height, focal, center, (k1, k2, 0, 0, 0)), ""
    if not d1:
        intrinsics, note = of_measurements(intrinsics, float(d0))
    R = rotation(pose[3:], f"{file}, line 1")
    camera = Camera(intrinsics, Pose(R, possible(checked_translation, pose[:3], "its pose")))
    return ForeignCamera(file.stem, camera, (note,) if note else ())


def _text(camera: Camera) -> str:
    k, pose = camera.intrinsics, camera.pose
    aspect = k.fy / k.fx
    across = k.width if k.width * aspect >= k.height else k.height / aspect
    k1, k2 = five(k.dist)[:2] if _centered(k) else (0.0, 0.0)
    if k1 and not k2:
        k2 = NEVER_ZERO
    inner = (k.fx / across, k1, k2, aspect, k.cx / k.width, k.cy / k.height)
    return f"{words([*pose.t, *pose.R.ravel()])}\n{words(inner)}\n"


def _centered(k: Intrinsics) -> bool:
    return (k.cx, k.cy) == (k.width / 2, k.height / 2)


def _lost(k: Intrinsics) -> str:
    k1, k2, p1, p2, k3 = five(k.dist)
    lost = {"p1": p1, "p2": p2, "k3": k3}
    if not _centered(k):
        lost = {"k1": k1, "k2": k2, **lost}
    higher = beyond_k3(k)
    return sentences([left_out({**lost, **higher})])

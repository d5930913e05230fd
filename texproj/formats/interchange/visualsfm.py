"""VisualSFM's .nvm (NVM_V3): the cameras of its first model.

A line a photo: name (spaces as quotes), focal length, quaternion w x y z (cam_from_world, OpenCV's
axes), center, radial distortion, 0. Pixels count from the picture's middle. Distortion is one of
measurements: a measured point m, in focal lengths, is seen at ``m (1 + k m^2)`` without distortion
(ccwu.me/vsfm/doc.html#nvm; PBA's DataInterface.h, SetNormalizedMeasurementDistortion). After
FixedK the head gives fx cx fy cy and the distortion for all.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from texproj.camera import Camera, Intrinsics
from texproj.errors import InputError, excerpt
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
    brown_terms,
    left_out,
    lens,
    numbers,
    pose_at,
    sentences,
    words,
)
from texproj.formats.interchange.radial import of_measurements
from texproj.formats.interchange.text import whole

HEAD = "NVM_V3"
FIXED = "FixedK"
NUMBERS_PER_CAMERA = 10
SPACE = '"'


def read_visualsfm(path: Path, size_of: SizeOf) -> ForeignModel:
    """The cameras of the first model; sizes are the photos'. Raises InputError for broken files."""
    lines = [(count, line.strip()) for count, line in enumerate(read_text(path).split("\n"), 1)]
    lines = [(count, line) for count, line in lines if line and not line.startswith("#")]
    if not lines or lines[0][1].split()[0] != HEAD:
        raise InputError(f"{path}: not VisualSFM's {HEAD}; save the model as .nvm there again")
    fixed = _fixed(lines[0][1].split()[1:], path)
    count = whole(lines[1][1]) if len(lines) > 1 else None
    if count is None:
        raise InputError(f"{path}, line 2: the number of cameras expected")
    rows = lines[2 : 2 + count]
    if len(rows) < count:
        raise InputError(f"{path}: ends in the middle of its {count} cameras")
    found, refused, absent = [], {}, []
    for at, line in rows:
        where = f"{path}, line {at}"
        name, *values = line.split()
        row = numbers(values[:NUMBERS_PER_CAMERA], NUMBERS_PER_CAMERA, where)
        name = name.replace(SPACE, " ")
        size = size_of(name)
        if size is None:
            absent.append(name)
            continue
        try:
            found.append(_camera(name, row, fixed, size, where))
        except Unusable as reason:
            refused[name] = str(reason)
    return ForeignModel(tuple(found), refused, tuple(absent))


def write_visualsfm(shots: Sequence[Shot]) -> Written:
    """One model without points: one focal length and a centered principal point a photo."""
    lines = [HEAD, "", str(len(shots))]
    for shot in shots:
        k, pose = shot.camera.intrinsics, shot.camera.pose
        x, y, z, w = Rotation.from_matrix(pose.R).as_quat()
        row = [(k.fx + k.fy) / 2, w, x, y, z, *pose.center, 0.0]
        lines.append(f"{shot.path.replace(' ', SPACE)} {words(row)} 0")
    lines += ["", "0", "", "0", ""]
    return Written.of({"cameras.nvm": "\n".join(lines).encode()}, shots, _lost)


def _fixed(words_: list[str], path: Path) -> Array | None:
    """fx cx fy cy and the distortion of all photos, where the head gives them."""
    if not words_ or words_[0] != FIXED:
        return None
    return numbers(words_[1:6], 5, f"{path}, line 1, {FIXED}")


def _camera(
    name: str, row: Array, fixed: Array | None, size: tuple[int, int], where: str
) -> ForeignCamera:
    f, quaternion, center, k = row[0], row[1:5], row[5:8], row[8]
    width, height = size
    focal, middle = (f, f), (width / 2, height / 2)
    if fixed is not None:
        focal, middle, k = (fixed[0], fixed[2]), (fixed[1], fixed[3]), fixed[4]
    if np.abs(quaternion).max() > 2 or not 0.5 < np.linalg.norm(quaternion) < 2:
        raise InputError(f"{where}, {excerpt(name)}: not a unit quaternion")
    w, x, y, z = quaternion
    R = Rotation.from_quat([x, y, z, w]).as_matrix()
    intrinsics, note = of_measurements(lens(width, height, focal, middle), float(k))
    return ForeignCamera(name, Camera(intrinsics, pose_at(R, center)), (note,) if note else ())


def _lost(k: Intrinsics) -> str:
    offset = {"cx - width/2": k.cx - k.width / 2, "cy - height/2": k.cy - k.height / 2}
    named = brown_terms(k)
    higher = beyond_k3(k)
    return sentences([left_out({"fx - fy": k.fx - k.fy, **offset, **named, **higher})])

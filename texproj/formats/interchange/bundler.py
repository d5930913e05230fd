"""Bundler's bundle.out (v0.3, as also Photo Tourism and VisualSFM write it) and its photo list.

``P = R X + t``, ``p = -P / P.z``, ``p' = f (1 + k1 |p|^2 + k2 |p|^4) p`` in pixels from the middle
of the image, y up, camera looking down its -z axis (Bundler User's Manual, "Output format").
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from texproj.camera import Camera, Intrinsics, Pose
from texproj.errors import InputError
from texproj.formats.interchange.model import (
    Y_AND_Z_FLIPPED,
    ForeignCamera,
    ForeignModel,
    Shot,
    SizeOf,
    Unusable,
    Written,
    five,
    left_out,
    lens,
    numbers,
    rotation,
    sentences,
    words,
)
from texproj.formats.interchange.text import read_text

NUMBERS_PER_CAMERA = 15


def read_bundler(path: Path, size_of: SizeOf) -> ForeignModel:
    """The cameras of a bundle.out with the photo list that lies beside it.

    The file tells neither image sizes nor principal points: the size is the photo's, the
    principal point its middle. Raises InputError for broken files and a missing list.
    """
    names = _names(path)
    rows = _cameras(path)
    if len(rows) != len(names):
        raise InputError(f"{path}: {len(rows)} cameras, but its list names {len(names)} photos")
    found, refused, absent = [], {}, []
    for name, row in zip(names, rows, strict=True):
        size = size_of(name)
        if row[0] == 0:
            refused[name] = "it has no camera there (focal length 0)"
        elif size is None:
            absent.append(name)
        else:
            try:
                found.append(ForeignCamera(name, _camera(row, size, f"{path}, {name}")))
            except Unusable as reason:
                refused[name] = str(reason)
    return ForeignModel(tuple(found), refused, tuple(absent))


def write_bundler(shots: Sequence[Shot]) -> Written:
    """bundle.out and list.txt. One focal length, a centered principal point, k1 and k2 is all
    that the format holds.
    """
    lines = ["# Bundle file v0.3", f"{len(shots)} 0"]
    for shot in shots:
        k, pose = shot.camera.intrinsics, shot.camera.pose
        k1, k2 = five(k.dist)[:2]
        rows = [[(k.fx + k.fy) / 2, k1, k2], *(Y_AND_Z_FLIPPED @ pose.R), Y_AND_Z_FLIPPED @ pose.t]
        lines += [words(row) for row in rows]
    listed = "".join(f"{shot.path}\n" for shot in shots)
    files = {"bundle.out": ("\n".join(lines) + "\n").encode(), "list.txt": listed.encode()}
    notes = {shot.name: note for shot in shots if (note := _lost(shot.camera.intrinsics))}
    return Written(files, notes)


def list_beside(path: Path) -> Path | None:
    """The photo list of a bundle.out: beside it, or in the folder above (as Bundler leaves it)."""
    names = (f"{path.name}.list.txt", f"{path.stem}.list.txt", "list.txt")
    for folder in (path.parent, path.parent.parent):
        for name in names:
            if (folder / name).is_file():
                return folder / name
    return None


def _names(path: Path) -> list[str]:
    listed = list_beside(path)
    if listed is None:
        raise InputError(
            f"{path}: the list of its photos (list.txt) is not beside it; put it there"
        )
    lines = [line.strip() for line in read_text(listed).splitlines() if line.strip()]
    return [_without_focal(line) for line in lines]


def _without_focal(line: str) -> str:
    """`name 0 focal` or `name`; names may hold spaces."""
    parts = line.rsplit(maxsplit=2)
    if len(parts) == 3 and parts[1] == "0":
        return parts[0]
    return line.removesuffix(" 0")


def _cameras(path: Path) -> list[np.ndarray]:
    lines = [line for line in read_text(path).splitlines() if not line.startswith("#")]
    head = lines[0].split() if lines else []
    if len(head) != 2 or not head[0].isdigit():
        raise InputError(f"{path}: not a Bundler file (number of cameras and points expected)")
    count = int(head[0])
    flat = " ".join(lines[1 : 1 + count * NUMBERS_PER_CAMERA]).split()
    values = flat[: count * NUMBERS_PER_CAMERA]
    if len(values) < count * NUMBERS_PER_CAMERA:
        raise InputError(f"{path}: ends in the middle of its {count} cameras")
    rows = numbers(values, count * NUMBERS_PER_CAMERA, f"{path}, cameras")
    return list(rows.reshape(count, NUMBERS_PER_CAMERA))


def _camera(row: np.ndarray, size: tuple[int, int], where: str) -> Camera:
    f, k1, k2 = row[:3]
    R = Y_AND_Z_FLIPPED @ rotation(row[3:12], where)
    width, height = size
    intrinsics = lens(width, height, f, (width / 2, height / 2), (k1, k2, 0.0, 0.0, 0.0))
    return Camera(intrinsics, Pose(R, Y_AND_Z_FLIPPED @ row[12:15]))


def _lost(k: Intrinsics) -> str:
    _, _, p1, p2, k3 = five(k.dist)
    offset = {"cx - width/2": k.cx - k.width / 2, "cy - height/2": k.cy - k.height / 2}
    higher = {f"dist[{i}]": v for i, v in enumerate(k.dist) if i > 4}
    return sentences(
        [left_out({"fx - fy": k.fx - k.fy, **offset, "p1": p1, "p2": p2, "k3": k3, **higher})]
    )

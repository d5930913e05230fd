"""Pix4Dmapper's PROJECT_calibrated_camera_parameters.txt, in its folder 1_initial/params.

After a header of seven lines, ten lines a photo: name, width, height; K by rows; R1 R2 R3; T1 T2;
position t; rotation R by rows; ``m = K [R | -R t] X`` with OpenCV's axes, lens R1 R2 R3 T1 T2 as
OpenCV's k1 k2 k3 p1 p2 ("How are the internal and external camera parameters defined",
support.pix4d.com). Pixels count from the corner, as Pix4D's Open Photogrammetry Format tells.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

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
    five,
    left_out,
    lens,
    numbers,
    pose_at,
    rotation,
    words,
)

HEADER = (
    "fileName imageWidth imageHeight", "camera matrix K [3x3]", "radial distortion [3x1]",
    "tangential distortion [2x1]", "camera position t [3x1]", "camera rotation R [3x3]",
    "camera model m = K [R|-Rt] X",
)  # fmt: skip
ENDING = "calibrated_camera_parameters.txt"
OFFSET_ENDING = "offset.xyz"
ROWS = (3, 3, 3, 3, 2, 3, 3, 3, 3)
"""Numbers in the lines after a photo's first."""


def read_pix4d(path: Path, size_of: SizeOf) -> ForeignModel:
    """The photos of a file of calibrated parameters. Raises InputError for broken files."""
    text = read_text(path)
    lines = [(count, line.strip()) for count, line in enumerate(text.split("\n"), 1)]
    lines = [(count, line) for count, line in lines if line]
    if not lines or lines[0][1] != HEADER[0] or len(lines) < len(HEADER):
        raise InputError(f"{path}: not Pix4D's calibrated camera parameters ({HEADER[0]!r} first)")
    body = lines[len(HEADER) :]
    found, refused = [], {}
    step = 1 + len(ROWS)
    for at in range(0, len(body), step):
        block = body[at : at + step]
        where = f"{path}, line {block[0][0]}"
        if len(block) < step:
            raise InputError(f"{where}: ends in the middle of a photo")
        parts = block[0][1].rsplit(maxsplit=2)
        if len(parts) != 3:
            raise InputError(f"{where}: name, width and height of a photo expected")
        width, height = numbers(parts[1:], 2, where)
        rows = [
            numbers(line, count, f"{path}, line {at_line}")
            for (at_line, line), count in zip(block[1:], ROWS, strict=True)
        ]
        try:
            camera = _camera(rows, width, height, f"{path}, {excerpt(parts[0])}")
            found.append(ForeignCamera(parts[0], camera))
        except Unusable as reason:
            refused[parts[0]] = str(reason)
    return ForeignModel(tuple(found), refused, notes=_notes(path))


def write_pix4d(shots: Sequence[Shot]) -> Written:
    """One file; lens terms beyond k3 are left out."""
    lines = [*HEADER, ""]
    for shot in shots:
        k, pose = shot.camera.intrinsics, shot.camera.pose
        k1, k2, p1, p2, k3 = five(k.dist)
        lines += [f"{shot.name} {k.width} {k.height}", *(words(row) for row in k.K)]
        lines += [words((k1, k2, k3)), words((p1, p2)), words(pose.center)]
        lines += [words(row) for row in pose.R]
    return Written.of({f"cameras_{ENDING}": ("\n".join(lines) + "\n").encode()}, shots, _lost)


def _camera(rows: Sequence[Array], width: float, height: float, where: str) -> Camera:
    K = np.stack(rows[:3])
    if K[0, 1] or K[1, 0] or not np.array_equal(K[2], (0, 0, 1)):
        raise InputError(f"{where}: K must be [fx 0 cx; 0 fy cy; 0 0 1]")
    (k1, k2, k3), (p1, p2) = rows[3], rows[4]
    focal, center = (K[0, 0], K[1, 1]), (K[0, 2], K[1, 2])
    intrinsics = lens(width, height, focal, center, (k1, k2, p1, p2, k3))
    return Camera(intrinsics, pose_at(rotation(np.stack(rows[6:]), where), rows[5]))


def _notes(path: Path) -> tuple[str, ...]:
    """A sentence where Pix4D has moved the coordinates: the file beside tells by how much."""
    name = path.name.removesuffix(ENDING) + OFFSET_ENDING
    if name == path.name or not (path.parent / name).is_file():
        return ()
    words_ = read_text(path.parent / name).split()
    if not words_ or all(word.strip("0.") == "" for word in words_):
        return ()
    return (
        f"coordinates are relative to {excerpt(' '.join(words_))} ({name});"
        " the mesh must be exported with the same offset",
    )


def _lost(k: Intrinsics) -> str:
    return left_out(beyond_k3(k))

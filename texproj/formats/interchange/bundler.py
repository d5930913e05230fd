"""Bundler's bundle.out (v0.3, as also Photo Tourism and VisualSFM write it) and its photo list.

``P = R X + t``, ``p = -P / P.z``, ``p' = f (1 + k1 |p|^2 + k2 |p|^4) p`` in pixels from the middle
of the image, y up, camera looking down its -z axis (Bundler User's Manual, "Output format").
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from texproj.camera import Camera, Intrinsics, Pose
from texproj.errors import InputError, excerpt
from texproj.formats.camera_bounds import checked_translation
from texproj.formats.documents import read_text
from texproj.formats.interchange.model import (
    Y_AND_Z_FLIPPED,
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
from texproj.formats.interchange.text import whole

NUMBERS_PER_CAMERA = 15
LIST_ENDINGS = (".list.txt", "_list.txt", "-list.txt", ".lst", ".txt")
LIST_NAMES = {
    "list.txt", "list_focal.txt", "list_imsize_focal.txt", "list_images.txt", "image_list.txt",
    "imagelist.txt", "images.txt", "photos.txt", "pictures.txt", "filelist.txt", "list.lst",
}  # fmt: skip
"""Bundler itself, VisualSFM, Photoscan, Pix4D, RealityCapture, OpenMVG and scripts around them."""
PHOTO_ENDINGS = (".jpg", ".jpeg", ".png", ".tif", ".tiff", ".pgm", ".ppm", ".bmp")
MOST_LIST_BYTES = 8 << 20
NUMBER = re.compile(r"[-+]?[0-9.]+(e[-+]?[0-9]+)?", re.IGNORECASE)
WORD = re.compile(r"\S+")


def read_bundler(path: Path, size_of: SizeOf) -> ForeignModel:
    """The cameras of a bundle.out with the photo list that lies beside it.

    The file tells neither image sizes nor principal points: the size is the photo's, the
    principal point its middle. Raises InputError for broken files and a missing list.
    """
    rows = _cameras(path)
    names = _names(path, len(rows))
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
                found.append(ForeignCamera(name, _camera(row, size, f"{path}, {excerpt(name)}")))
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
    return Written.of(files, shots, _lost)


def list_beside(path: Path, count: int) -> Path | None:
    """The list of a bundle.out's photos: beside it, or in the folder above (as Bundler leaves it),
    under any of the names that programs give it, or the one text file of `count` photo names.
    """
    stem = path.name.partition(".")[0].lower()
    own = {f"{path.name.lower()}.list.txt"}
    own |= {f"{s}{end}" for s in (path.stem.lower(), stem) for end in LIST_ENDINGS}
    for folder in (path.parent, path.parent.parent):
        texts = sorted(p for p in folder.iterdir() if p.suffix.lower() in (".txt", ".lst"))
        for known in (own, LIST_NAMES):
            found = [p for p in texts if p.name.lower() in known and p.is_file()]
            if found:
                return found[0]
        alike = [p for p in texts if p.is_file() and _lists_photos(p, count)]
        if len(alike) == 1:
            return alike[0]
    return None


def _lists_photos(path: Path, count: int) -> bool:
    """Whether a text names `count` photos, one a line, and nothing else."""
    if path.stat().st_size > MOST_LIST_BYTES:
        return False
    try:
        names = _listed(path)
    except InputError:
        return False
    return len(names) == count > 0 and all(n.lower().endswith(PHOTO_ENDINGS) for n in names)


def _listed(path: Path) -> list[str]:
    lines = [line.strip() for line in read_text(path).splitlines() if line.strip()]
    return [_without_numbers(line) for line in lines]


def _names(path: Path, count: int) -> list[str]:
    listed = list_beside(path, count)
    if listed is None:
        raise InputError(
            f"{path}: the list of its photos (list.txt) is not beside it; put it there, one name"
            " a line in the order of the cameras"
        )
    return _listed(listed)


def _without_numbers(line: str) -> str:
    """`name`, `name 0 focal` or `name width height focal`; names may hold spaces and quotes."""
    parts = line.split()
    while len(parts) > 1 and NUMBER.fullmatch(parts[-1]):
        parts.pop()
    name = line[: [match.end() for match in WORD.finditer(line)][len(parts) - 1]].strip('"')
    plain = line.strip('"')
    return name if name.lower().endswith(PHOTO_ENDINGS) else plain.removesuffix(" 0")


def _cameras(path: Path) -> list[np.ndarray]:
    lines = [line for line in read_text(path).splitlines() if not line.startswith("#")]
    head = lines[0].split() if lines else []
    count = whole(head[0]) if len(head) == 2 else None
    if count is None:
        raise InputError(f"{path}: not a Bundler file (number of cameras and points expected)")
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
    t = possible(checked_translation, row[12:15], "its pose")
    return Camera(intrinsics, Pose(R, Y_AND_Z_FLIPPED @ t))


def _lost(k: Intrinsics) -> str:
    _, _, p1, p2, k3 = five(k.dist)
    offset = {"cx - width/2": k.cx - k.width / 2, "cy - height/2": k.cy - k.height / 2}
    higher = beyond_k3(k)
    return sentences(
        [left_out({"fx - fy": k.fx - k.fy, **offset, "p1": p1, "p2": p2, "k3": k3, **higher})]
    )

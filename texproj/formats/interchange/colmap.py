"""COLMAP models, text and binary: https://colmap.github.io/format.html, cameras.html.

Poses are cam_from_world with OpenCV's axes, pixels as ours. Points and rigs are not read: since
COLMAP 3.12 a photo's pose in images.* is still the whole of it.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from texproj.camera import Camera, Intrinsics, Pose
from texproj.errors import InputError, excerpt
from texproj.formats.camera_bounds import checked_translation
from texproj.formats.documents import read_bytes, read_text
from texproj.formats.interchange.model import (
    ForeignCamera,
    ForeignModel,
    Shot,
    SizeOf,
    Unusable,
    Written,
    left_out,
    lens,
    numbers,
    possible,
    words,
)
from texproj.formats.interchange.radial import fisheye
from texproj.formats.interchange.text import whole

MODELS: dict[str, tuple[int, int]] = {
    "SIMPLE_PINHOLE": (0, 3), "PINHOLE": (1, 4), "SIMPLE_RADIAL": (2, 4), "RADIAL": (3, 5),
    "OPENCV": (4, 8), "OPENCV_FISHEYE": (5, 8), "FULL_OPENCV": (6, 12), "FOV": (7, 5),
    "SIMPLE_RADIAL_FISHEYE": (8, 4), "RADIAL_FISHEYE": (9, 5), "THIN_PRISM_FISHEYE": (10, 12),
    "RAD_TAN_THIN_PRISM_FISHEYE": (11, 16), "SIMPLE_DIVISION": (12, 4), "DIVISION": (13, 5),
    "SIMPLE_FISHEYE": (14, 3), "FISHEYE": (15, 4), "EUCM": (16, 6), "EQUIRECTANGULAR": (17, 2),
}  # fmt: skip
"""Number and count of parameters of each camera model (src/colmap/sensor/models.h)."""

NAME_OF_NUMBER = {number: name for name, (number, _) in MODELS.items()}
BEYOND_OPENCV = ("s1", "s2", "s3", "s4", "tau_x", "tau_y")

LENSES: dict[str, Callable[[Sequence[float]], tuple[ArrayLike, ArrayLike, ArrayLike]]] = {
    "SIMPLE_PINHOLE": lambda p: (p[0], p[1:3], (0.0,) * 5),
    "PINHOLE": lambda p: (p[:2], p[2:4], (0.0,) * 5),
    "SIMPLE_RADIAL": lambda p: (p[0], p[1:3], (p[3], 0.0, 0.0, 0.0, 0.0)),
    "RADIAL": lambda p: (p[0], p[1:3], (p[3], p[4], 0.0, 0.0, 0.0)),
    "OPENCV": lambda p: (p[:2], p[2:4], (*p[4:8], 0.0)),
    "FULL_OPENCV": lambda p: (p[:2], p[2:4], tuple(p[4:12])),
}
"""Focal lengths, principal point and OpenCV distortion of a model's parameters."""

FISHEYES: dict[str, Callable[[Sequence[float]], tuple[Sequence[float], ...]]] = {
    "SIMPLE_FISHEYE": lambda p: ((p[0], p[0]), p[1:3], ()),
    "FISHEYE": lambda p: (p[:2], p[2:4], ()),
    "OPENCV_FISHEYE": lambda p: (p[:2], p[2:4], p[4:8]),
    "THIN_PRISM_FISHEYE": lambda p: (p[:2], p[2:4], [p[i] for i in (4, 5, 8, 9, 6, 7, 10, 11)]),
    "SIMPLE_RADIAL_FISHEYE": lambda p: ((p[0], p[0]), p[1:3], p[3:4]),
    "RADIAL_FISHEYE": lambda p: ((p[0], p[0]), p[1:3], p[3:5]),
}
"""Focal lengths, principal point and the coefficients of `texproj.fisheye`."""

RawCamera = tuple[str, float, float, Sequence[float]]
"""Model, width, height, parameters."""
RawImage = tuple[str, int, Sequence[float]]
"""Name, number of the camera, quaternion w x y z and translation."""


def read_colmap(path: Path, size_of: SizeOf) -> ForeignModel:
    """The cameras of the COLMAP model in folder `path`; binary files win over text ones.

    Raises InputError for a folder without a model and for broken files.
    """
    binary = (path / "images.bin").is_file() or not (path / "images.txt").is_file()
    ending = ".bin" if binary else ".txt"
    files = [path / f"cameras{ending}", path / f"images{ending}"]
    for file in files:
        if not file.is_file():
            raise InputError(f"{path}: no COLMAP model there ({file.name} is missing)")
    cameras = (_binary_cameras if binary else _text_cameras)(files[0])
    found, refused = [], {}
    for name, number, values in (_binary_images if binary else _text_images)(files[1]):
        where = f"{files[1]}, {excerpt(name)}"
        if number not in cameras:
            raise InputError(f"{where}: camera {number} is not in {files[0].name}")
        try:
            intrinsics, note = _intrinsics(cameras[number])
            camera = Camera(intrinsics, _pose(values, where))
            found.append(ForeignCamera(name, camera, (note,) if note else ()))
        except Unusable as reason:
            refused[name] = str(reason)
    return ForeignModel(tuple(found), refused)


def write_colmap(shots: Sequence[Shot], binary: bool = False) -> Written:
    """A model of one camera per photo, without points. Lens terms beyond k6 are left out."""
    cameras = [_parameters(shot.camera.intrinsics) for shot in shots]
    write = _write_binary if binary else _write_text
    return Written.of(write(shots, cameras), shots, _lost)


def _intrinsics(raw: RawCamera) -> tuple[Intrinsics, str]:
    """The lens and a note."""
    model, width, height, parameters = raw
    if model in FISHEYES:
        focal, center, k = FISHEYES[model]([float(p) for p in parameters])
        return fisheye((width, height), focal, center, k)
    if model not in LENSES:
        raise Unusable(
            f"its lens model {model} is not one of OpenCV's;"
            f" undistort the photos in COLMAP (image_undistorter) and import that model"
        )
    f, c, dist = LENSES[model]([float(p) for p in parameters])
    return lens(width, height, f, c, dist), ""


def _pose(values: Sequence[float], where: str) -> Pose:
    w, x, y, z, *t = values
    turned = np.isfinite(values).all() and np.abs([w, x, y, z]).max() < 2
    if not turned or not 0.5 < np.linalg.norm([w, x, y, z]) < 2:
        raise InputError(f"{where}: not a pose (a unit quaternion and a translation)")
    R = Rotation.from_quat([x, y, z, w]).as_matrix()
    return Pose(R, possible(checked_translation, t, "its pose"))


# --- text


def _rows(path: Path) -> Iterator[tuple[int, str]]:
    for count, line in enumerate(read_text(path).splitlines(), 1):
        if not line.lstrip().startswith("#"):
            yield count, line.strip()


def _text_cameras(path: Path) -> dict[int, RawCamera]:
    cameras: dict[int, RawCamera] = {}
    for count, line in _rows(path):
        if not line:
            continue
        where = f"{path}, line {count}"
        number, model, *rest = [*line.split(), "", ""][: max(2, len(line.split()))]
        key = whole(number)
        if model not in MODELS or key is None:
            raise InputError(f"{where}: not a camera (number, model, width, height, parameters)")
        width, height, *parameters = numbers(rest, 2 + MODELS[model][1], where)
        cameras[key] = (model, width, height, parameters)
    return cameras


def _text_images(path: Path) -> Iterator[RawImage]:
    """Every second line holds the observations. It may be empty, and where scripts have taken empty
    lines out it may be missing: an image where observations are due is an image.
    """
    observations = False
    for count, line in _rows(path):
        if not line:
            observations = False
            continue
        image = _text_image(line)
        if observations and (image is None or _is_observations(line)):
            observations = False
            continue
        if image is None:
            raise InputError(
                f"{path}, line {count}: not an image (number, quaternion, translation, camera,"
                f" name)"
            )
        observations = True
        name, number, words = image
        yield name, number, numbers(words, 7, f"{path}, line {count}").tolist()


def _text_image(line: str) -> tuple[str, int, list[str]] | None:
    """Name, number of the camera, and quaternion and translation of a line; None if it has none."""
    parts = line.split(maxsplit=9)
    number = whole(parts[8]) if len(parts) == 10 else None
    if number is None or whole(parts[0]) is None:
        return None
    return parts[9], number, parts[1:8]


def _is_observations(line: str) -> bool:
    """Whether a line is x, y and number of a point, again and again. Only numbers are: a photo's
    name hardly ever is one.
    """
    words = line.split()
    return len(words) % 3 == 0 and all(_is_number(word) for word in words)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _write_text(
    shots: Sequence[Shot], cameras: Sequence[tuple[str, list[float]]]
) -> dict[str, bytes]:
    lenses, images = ["# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]"], [
        "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then a line of observations"
    ]  # fmt: skip
    for i, (shot, (model, values)) in enumerate(zip(shots, cameras, strict=True), 1):
        camera = shot.camera
        lenses.append(f"{i} {model} {camera.width} {camera.height} {words(values)}")
        images += [f"{i} {words(_seven(camera.pose))} {i} {shot.name}", ""]
    return {
        "cameras.txt": ("\n".join(lenses) + "\n").encode(),
        "images.txt": ("\n".join(images) + "\n").encode(),
        "points3D.txt": b"# POINT3D_ID X Y Z R G B ERROR TRACK[]\n",
    }


# --- binary


class _Bytes:
    """A cursor over a little-endian file."""

    def __init__(self, path: Path) -> None:
        self.path, self.data, self.at = path, read_bytes(path), 0

    def take(self, kinds: str) -> tuple[float, ...]:
        values = struct.Struct(f"<{kinds}")
        if self.at + values.size > len(self.data):
            raise InputError(f"{self.path}: ends in the middle; copy it again")
        self.at += values.size
        return values.unpack_from(self.data, self.at - values.size)

    def skip(self, count: int) -> None:
        self.at = min(self.at + count, len(self.data))

    def name(self) -> str:
        end = self.data.find(b"\0", self.at)
        if end < 0:
            raise InputError(f"{self.path}: ends in the middle; copy it again")
        text = self.data[self.at : end].decode("utf-8", "replace")
        self.at = end + 1
        return text


def _binary_cameras(path: Path) -> dict[int, RawCamera]:
    data = _Bytes(path)
    cameras: dict[int, RawCamera] = {}
    for _ in range(int(data.take("Q")[0])):
        number, model, width, height = data.take("IiQQ")
        name = NAME_OF_NUMBER.get(int(model))
        if name is None:
            raise InputError(f"{path}: camera {number} has the unknown model {model}")
        cameras[int(number)] = (name, width, height, data.take(f"{MODELS[name][1]}d"))
    return cameras


def _binary_images(path: Path) -> Iterator[RawImage]:
    data = _Bytes(path)
    for _ in range(int(data.take("Q")[0])):
        values = data.take("I7dI")
        name = data.name()
        data.skip(24 * int(data.take("Q")[0]))
        yield name, int(values[8]), values[1:8]


def _write_binary(
    shots: Sequence[Shot], cameras: Sequence[tuple[str, list[float]]]
) -> dict[str, bytes]:
    count = struct.pack("<Q", len(shots))
    lenses, images = [count], [count]
    for i, (shot, (model, values)) in enumerate(zip(shots, cameras, strict=True), 1):
        size = shot.camera.width, shot.camera.height
        lenses.append(struct.pack(f"<IiQQ{len(values)}d", i, MODELS[model][0], *size, *values))
        images.append(struct.pack("<I7dI", i, *_seven(shot.camera.pose), i))
        images.append(shot.name.encode() + b"\0" + struct.pack("<Q", 0))
    return {
        "cameras.bin": b"".join(lenses),
        "images.bin": b"".join(images),
        "points3D.bin": struct.pack("<Q", 0),
    }


# --- our cameras as COLMAP's


def _seven(pose: Pose) -> list[float]:
    x, y, z, w = Rotation.from_matrix(pose.R).as_quat()
    return [w, x, y, z, *pose.t]


def _parameters(k: Intrinsics) -> tuple[str, list[float]]:
    """The smallest model that holds the lens."""
    base = [k.fx, k.fy, k.cx, k.cy]
    if k.is_fisheye:
        if not any(k.dist[4:]):
            return "OPENCV_FISHEYE", base + list(k.dist[:4])
        k1, k2, k3, k4, p1, p2, s1, s2 = k.dist
        return "THIN_PRISM_FISHEYE", [*base, k1, k2, p1, p2, k3, k4, s1, s2]
    dist = [*k.dist, *(0.0,) * 8][:8]
    if not any(dist):
        return "PINHOLE", base
    return ("FULL_OPENCV", base + dist) if any(dist[4:]) else ("OPENCV", base + dist[:4])


def _lost(k: Intrinsics) -> str:
    beyond = () if k.is_fisheye else k.dist[8:]
    return left_out(dict(zip(BEYOND_OPENCV, beyond, strict=False)))

"""`texproj calibrate-flash`: the flash and the lens told from photos of a white wall."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.appearance.flash.lamp import OF_SENSOR
from texproj.appearance.wall.flash_fit import FEWEST_PHOTOS, FlashFit, fit_flash
from texproj.appearance.wall.wall_squares import wall_patches
from texproj.camera import Camera, Intrinsics, Pose
from texproj.errors import InputError
from texproj.files import write_atomically
from texproj.formats.photos import PHOTO_SUFFIXES, read_photo, read_photo_info
from texproj.intake import find_photos
from texproj.photo import Photo
from texproj.project import Project
from texproj.stages.flash_file import flash_text
from texproj.stages.outcomes import Tally

FILE = "flash.json"
LONGEST = 1600
"""Pixels of the longer side to which photos are reduced: corners are found to a tenth of one."""

SQUARES = 7, 5
MARKER = 0.75
"""Of the board: squares across and down, edge of a marker against that of its square."""

DICTIONARY = cv2.aruco.DICT_4X4_50
FEWEST_CORNERS = 8
MARGIN = 1.0
"""Squares around the board that are left out of the wall: its edge casts a shadow."""

BOARD_PX = 200
"""Pixels of a square of the board's picture."""

MOST_RESIDUAL_PX = 1.0
STEADY = 0.1
"""Spread (log) of the photos' light up to which they were of one exposure."""


@dataclass(frozen=True, eq=False)
class CalibrationOutcome:
    """file: flash.json; fit: what it holds; failed: photos of the wall that could not be used, and
    why; residual_px: rms of the board's corners.
    """

    file: Path
    fit: FlashFit
    used: tuple[str, ...]
    failed: dict[str, str]
    residual_px: float

    @property
    def tally(self) -> Tally:
        return Tally(len(self.failed), len(self.failed) + len(self.used), "used")

    def lines(self) -> Iterator[str]:
        """For people."""
        lamp = self.fit.lamp
        right, down, front = lamp.place
        yield f"wrote {self.file} from {len(self.used)} photos of the wall"
        yield (
            f"the flash is {right:.4g} right of the lens, {down:.4g} below and {front:.4g} in front"
            f" of it; known up to {np.degrees(np.arccos(lamp.widest)):.0f} degrees from its axis"
        )
        yield (
            f"the halves of the photos agree to {100 * self.fit.lens_apart:.1f} % in the lens,"
            f" {100 * self.fit.flash_apart:.1f} % in the flash, {self.fit.place_apart:.2g} in its"
            " place"
        )
        for name, reason in self.failed.items():
            yield f"{name}: FAILED: {reason}"

    def as_dict(self) -> dict[str, Any]:
        """For --json."""
        return {
            "file": str(self.file),
            "used": list(self.used),
            "failed": self.failed,
            "lamp": self.fit.lamp.place.tolist(),
            **_quality(self.fit, self.residual_px),
        }


def board_picture() -> NDArray[np.uint8]:
    """(h, w) the board, to be printed and put flat on the wall."""
    size = (SQUARES[0] * BOARD_PX, SQUARES[1] * BOARD_PX)
    return np.asarray(_board(1.0).generateImage(size), np.uint8)


def calibrate_flash(
    project: Project, wall: Path, square: float, reflectance: float | None = None
) -> CalibrationOutcome:
    """Write flash.json into the project from a folder of photos of a white wall that bears the
    board.

    square: edge of the board's squares, as printed, in units of the scan; reflectance: of the wall,
    where the photos were exposed like those of the piece; it makes base colors absolute. Raises
    InputError where the photos do not tell the flash; nothing is written then.
    """
    shots, failed = _shots(wall)
    cameras, residual = _cameras(shots, square)
    if residual > MOST_RESIDUAL_PX:
        raise InputError(
            f"the board is found to {residual:.1f} pixels only; it must lie flat, and the photos be"
            " sharp"
        )
    walls = [_wall(camera, square) for camera in cameras]
    lights = [shot.photo.linear() for shot in shots]
    fit = fit_flash(wall_patches(cameras, lights, walls))
    if fit.reason:
        raise InputError(fit.reason)
    fit = replace(fit, lamp=_in_sensor(fit, shots, reflectance))
    path = project.root / FILE
    write_atomically(path, flash_text(fit.lamp, _quality(fit, residual)))
    return CalibrationOutcome(path, fit, tuple(shot.name for shot in shots), failed, residual)


def _quality(fit: FlashFit, residual: float) -> dict[str, float]:
    return {
        "spread": fit.spread,
        "lens_apart": fit.lens_apart,
        "flash_apart": fit.flash_apart,
        "place_apart": fit.place_apart,
        "residual_px": residual,
    }


@dataclass(frozen=True, eq=False)
class _Shot:
    """A photo of the wall; corners: (n, 2) pixels and numbers (n,) of the board's corners."""

    name: str
    photo: Photo
    corners: NDArray[np.float64]
    numbers: NDArray[np.intp]


def _shots(wall: Path) -> tuple[list[_Shot], dict[str, str]]:
    """The photos that show the board. Raises InputError for fewer than are needed."""
    if not wall.is_dir():
        raise InputError(f"no folder of photos at {wall}")
    shots, failed = [], {}
    for path in find_photos(wall, PHOTO_SUFFIXES).paths.values():
        try:
            photo = read_photo(path, read_photo_info(path), longest=LONGEST)
        except InputError as error:
            failed[path.name] = str(error)
            continue
        corners, numbers = _corners(photo)
        if len(numbers) < FEWEST_CORNERS:
            failed[path.name] = (
                f"{len(numbers)} corners of the board are seen; it needs {FEWEST_CORNERS}"
            )
        else:
            shots.append(_Shot(path.name, photo, corners, numbers))
    if len(shots) < FEWEST_PHOTOS:
        told = "; ".join(f"{name}: {reason}" for name, reason in failed.items())
        raise InputError(
            f"{len(shots)} photos in {wall} show the board; {FEWEST_PHOTOS} are needed"
            + (f" ({told})" if told else "")
        )
    if len({shot.photo.info.orientation for shot in shots}) > 1:
        raise InputError(
            f"the photos in {wall} are upright and on the side; hold the camera one way"
        )
    if len({(shot.photo.width, shot.photo.height) for shot in shots}) > 1:
        raise InputError(f"the photos in {wall} differ in size; use one camera")
    return shots, failed


def _board(square: float) -> Any:
    dictionary = cv2.aruco.getPredefinedDictionary(DICTIONARY)
    return cv2.aruco.CharucoBoard(SQUARES, square, MARKER * square, dictionary)


def _corners(photo: Photo) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    gray = np.round(photo.gray() * 255).astype(np.uint8)
    corners, numbers, *_ = cv2.aruco.CharucoDetector(_board(1.0)).detectBoard(gray)
    if numbers is None:
        return np.zeros((0, 2)), np.zeros(0, np.intp)
    return corners.reshape(-1, 2) + 0.5, numbers.ravel().astype(np.intp)


def _cameras(shots: Sequence[_Shot], square: float) -> tuple[list[Camera], float]:
    """The cameras in the frame of the board, and the rms residual of its corners, pixels.

    One lens for all: Zhang, "A flexible new technique for camera calibration", PAMI 2000. Its
    middle is sought too, since 8 pixels turn all poses by 5 milliradians; of its distortion one
    term, since more of them run wild where the board does not reach.
    """
    points = np.asarray(_board(square).getChessboardCorners(), np.float32)
    size = shots[0].photo.width, shots[0].photo.height
    flags = cv2.CALIB_FIX_ASPECT_RATIO | cv2.CALIB_ZERO_TANGENT_DIST
    flags |= cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3 | cv2.CALIB_USE_INTRINSIC_GUESS
    guess = np.array([[max(size), 0, size[0] / 2], [0, max(size), size[1] / 2], [0, 0, 1.0]])
    residual, K, dist, turns, moves = cv2.calibrateCamera(
        [points[shot.numbers] for shot in shots],
        [shot.corners.astype(np.float32) for shot in shots], size, guess, np.zeros(5), flags=flags,
    )  # fmt: skip
    lens = Intrinsics.from_K(K, *size, dist.ravel()[:5])
    poses = [Pose(cv2.Rodrigues(r)[0], t.ravel()) for r, t in zip(turns, moves, strict=True)]
    return [Camera(lens, pose) for pose in poses], float(residual)


def _wall(camera: Camera, square: float) -> NDArray[np.bool_]:
    """(h, w) all but the board and what is close to it."""
    x, y = ((-MARGIN, n + MARGIN) for n in SQUARES)
    quad = np.array([(x[i], y[j], 0) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))]) * square
    edge = np.concatenate([np.linspace(quad[k], quad[(k + 1) % 4], 20) for k in range(4)])
    out = np.ones((camera.height, camera.width), np.uint8)
    xy = np.nan_to_num(camera.project(edge)[0])
    cv2.fillPoly(out, [np.round(xy).astype(np.int32)], 0)
    return out > 0


def _in_sensor(fit: FlashFit, shots: Sequence[_Shot], reflectance: float | None) -> Any:
    """The lamp in the axes of the camera held as its sensor is, with its intensity if known."""
    turn = np.eye(3)
    turn[:2, :2] = OF_SENSOR.get(shots[0].photo.info.orientation, OF_SENSOR[1])
    intensity = None
    if reflectance is not None:
        if np.std(fit.gains) > STEADY:
            raise InputError(
                "the photos of the wall are of different exposure, so that the wall's reflectance"
                " tells nothing: leave it out, or photograph with one setting"
            )
        intensity = float(np.exp(np.median(fit.gains)) * np.pi / reflectance)
    lamp = fit.lamp
    return replace(lamp, place=turn.T @ lamp.place, axis=turn.T @ lamp.axis, intensity=intensity)

"""A flash told from a lens by a white wall. The truth has other curves than those that are fitted:
a rational lens, a flash like a bell; the board is drawn into the photos by a homography.
"""

import json
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
from PIL import Image

from texproj.appearance.flash.lamp import ANGLE_SCALE, Lamp, polynomial
from texproj.appearance.wall.flash_fit import fit_flash
from texproj.appearance.wall.wall_squares import wall_patches
from texproj.camera import Camera, Intrinsics, Pose
from texproj.cli import main
from texproj.errors import InputError
from texproj.photo import srgb_from_linear
from texproj.stages import calibrating
from texproj.stages.calibrating import SQUARES, board_picture
from texproj.stages.flash_file import flash_text, read_flash

LAMP = np.array([0.06, -0.045, 0.01])
AXIS = np.array([0.03, 0.05, 1.0]) / np.linalg.norm([0.03, 0.05, 1.0])
SIZE, FOCAL = (480, 360), 420.0
NEAR, FAR = 0.7, 1.8


def lens(rho):
    return (1 + 0.55 * rho) ** -1.3


def flash(cosine):
    angle = np.arccos(np.clip(cosine, -1, 1))
    return np.exp(-((angle / 0.75) ** 2.6)) * (1 - 0.12 * angle)


def pose(number, count, near, far, tilt):
    """Around the wall's origin, at growing distance, the camera turned a little about its axis."""
    d = near * (far / near) ** (number / max(count - 1, 1))
    t, a = np.radians(tilt * (0.3 + 0.7 * (number * 7 % 5) / 4)), 2.4 * number
    center = d * np.array([np.sin(t) * np.cos(a), np.sin(t) * np.sin(a), np.cos(t)])
    up = (0.2 * np.sin(number), 1.0, 0.1)
    center += np.array([0.05 * d * np.cos(3 * number), 0, 0])
    return Pose.look_at(center, [0, 0, 0], up=up), d


def taken(camera, exposure, albedo, seed):
    """(h, w, 3) uint8 sRGB photo of the wall z = 0 of an albedo (h, w), with noise."""
    w, h = SIZE
    x, y = np.meshgrid(np.arange(w) + 0.5, np.arange(h) + 0.5)
    xy = np.column_stack([x.ravel(), y.ravel()])
    origin, ray = camera.rays(xy)
    away = origin - ray * (origin[:, 2] / ray[:, 2])[:, None] - camera.pose.inverse.apply([LAMP])
    far = np.linalg.norm(away, axis=1)
    cosine = away @ (camera.pose.R.T @ AXIS) / far
    rho = ((xy - [w / 2, h / 2]) ** 2).sum(1) / (w * w / 4 + h * h / 4)
    light = exposure * np.abs(away[:, 2]) / far**3 * flash(cosine) * lens(rho)
    light = light.reshape(h, w) * albedo
    noise = np.random.default_rng(seed).standard_normal(light.shape)
    light = light + np.sqrt(light / 15000 + 0.0015**2) * noise
    shown = np.round(srgb_from_linear(np.repeat(light[..., None], 3, axis=2)) * 255)
    return shown.astype(np.uint8)


@cache
def wall(count=12, near=NEAR, far=FAR, tilt=30.0):
    """Cameras and photos."""
    cameras, photos = [], []
    for number in range(count):
        where, d = pose(number, count, near, far, tilt)
        lens_of = Intrinsics(*SIZE, FOCAL, FOCAL, SIZE[0] / 2, SIZE[1] / 2)
        cameras.append(Camera(lens_of, where))
        photos.append(taken(cameras[-1], 0.6 * d * d, 1.0, number))
    return cameras, photos


def fitted(cameras, photos):
    light = [np.where(p <= 10, p / 3294.6, ((p / 255 + 0.055) / 1.055) ** 2.4) for p in photos]
    everywhere = [np.ones(SIZE[::-1], bool)] * len(photos)
    return fit_flash(wall_patches(cameras, [x.astype(np.float32) for x in light], everywhere))


def errors(lamp):
    """Largest relative error of the lens, rms of the flash, and of the lamp's place."""
    rho = np.linspace(0, lamp.reach, 50)
    of_lens = np.exp(polynomial(lamp.vignetting, rho)) / lens(rho)
    cosine = np.linspace(1, lamp.widest, 60)
    of_flash = np.exp(polynomial(lamp.profile, ANGLE_SCALE * (1 - cosine))) / flash(cosine)
    place = float(np.linalg.norm(lamp.place - LAMP))
    return np.abs(of_lens - 1).max(), np.std(of_flash) / of_flash.mean(), place


def test_lens_flash_and_place_are_parted():
    """By 12 photos from 0.7 to 1.8 m, tilted up to 30 degrees: .5 %, 1 % and 3 mm."""
    fit = fitted(*wall())

    assert not fit.reason
    of_lens, of_flash, place = errors(fit.lamp)
    assert of_lens < 0.005
    assert of_flash < 0.01
    assert place < 0.003
    assert np.degrees(np.arccos(fit.lamp.widest)) < 60
    assert fit.lamp.strength(np.array([fit.lamp.widest - 0.01], np.float32)) == 0


def test_poses_may_be_a_milliradian_off():
    """Which would move the lamp by centimetres, had each photo not a slope of its own."""
    cameras, photos = wall()
    rng = np.random.default_rng(5)
    turned = [
        replace(c, pose=Pose(cv2.Rodrigues(rng.normal(0, 0.0007, 3))[0] @ c.pose.R, c.pose.t))
        for c in cameras
    ]
    fit = fitted(turned, photos)

    of_lens, of_flash, place = errors(fit.lamp)
    assert of_lens < 0.02
    assert of_flash < 0.02
    assert place < 0.01


def test_photos_from_one_place_are_refused():
    """There the flash's light and the lens's lie in the same places of all pictures."""
    fit = fitted(*wall(8, 1.0, 1.0, 0.0))

    assert "from one distance, squarely" in fit.reason
    assert "tilted up to 30 degrees" in fit.reason


def test_what_is_no_white_wall_is_refused():
    """Wall paper."""
    cameras, photos = wall()
    rng = np.random.default_rng(0)
    paper = cv2.resize(rng.uniform(0.85, 1, (12, 16)), SIZE, interpolation=cv2.INTER_CUBIC)
    spoilt = [
        (p * np.roll(paper, 50 * k)[..., None]).astype(np.uint8) for k, p in enumerate(photos)
    ]

    assert "evenly white wall" in fitted(cameras, spoilt).reason


def test_a_few_photos_are_not_enough():
    with pytest.raises(ValueError, match="6 are needed"):
        fitted(*(some[:5] for some in wall()))


@pytest.fixture
def wall_folder(tmp_path):
    """Photos of the wall with the board on it, 6 cm a square."""
    folder, square = tmp_path / "wall", 0.06
    folder.mkdir()
    board = board_picture() / 255.0
    per_m = board.shape[1] / (SQUARES[0] * square)
    w, h = SIZE
    for number, camera in enumerate(wall()[0]):
        to_photo = camera.intrinsics.K @ np.column_stack([
            camera.pose.R[:, :2], camera.pose.t
        ])  # fmt: skip
        middle = np.array(board.shape[1::-1]) / 2
        to_wall = np.array([[1, 0, -middle[0]], [0, -1, middle[1]], [0, 0, per_m]])
        albedo = cv2.warpPerspective(
            board, to_photo @ to_wall, (w, h), flags=cv2.INTER_AREA, borderValue=1.0
        )
        d = np.linalg.norm(camera.center)
        photo = taken(camera, 0.6 * d * d, 0.05 + 0.95 * albedo, number)
        Image.fromarray(photo).save(folder / f"{number:02}.png")
    return folder


def seen_exactly(shots, square):
    """The true cameras in the frame of the board, whose y is down and z into the wall."""
    known = {f"{number:02}.png": camera for number, camera in enumerate(wall()[0])}
    turn, middle = np.diag([1.0, -1, -1]), np.array(SQUARES) * square / 2
    cameras = []
    for shot in shots:
        camera = known[shot.name]
        moved = camera.pose.R @ [-middle[0], middle[1], 0] + camera.pose.t
        cameras.append(Camera(camera.intrinsics, Pose(camera.pose.R @ turn, moved)))
    return cameras, 0.1


def test_a_board_seen_too_small_is_refused(wall_folder, project_folder, capsys):
    """At 480 pixels its poses are some milliradians off, too much to part flash and lens."""
    code = main(
        ["calibrate-flash", str(project_folder), "--wall", str(wall_folder), "--square", "0.06"]
    )
    assert code == 2
    assert not (project_folder / "flash.json").exists()
    assert "the flash cannot be told from the lens by these photos" in capsys.readouterr().err


def test_the_command_writes_the_flash(wall_folder, project_folder, capsys, monkeypatch):
    """A board seen exactly; a project that names the file knows the lamp from it."""
    monkeypatch.setattr(calibrating, "_cameras", seen_exactly)
    code = main(
        ["calibrate-flash", str(project_folder), "--wall", str(wall_folder), "--square", "0.06"]
    )

    said = capsys.readouterr()
    assert code == 0, said.err
    assert "right of the lens" in said.out
    lamp = read_flash(project_folder / "flash.json")
    of_lens, of_flash, place = errors(lamp)
    assert of_lens < 0.02
    assert of_flash < 0.02
    assert place < 0.005
    content = json.loads((project_folder / "flash.json").read_text())
    content["lamp"] = [1, 2]
    (project_folder / "flash.json").write_text(json.dumps(content))
    with pytest.raises(InputError, match=r"flash.json: lamp"):
        read_flash(project_folder / "flash.json")


@pytest.mark.parametrize(
    "slip",
    [
        {"lamp": [1e300, 0, 0]}, {"profile": [1e300, 1e300]}, {"vignetting": [-1e6]},
        {"widest_deg": 0}, {"reach": -3}, {"intensity": 0}, {"intensity": 1e-300},
        {"axis": [0, 0, 0]}, {"axis": [1e-300, 0, 0]}, {"axis": [0, 1e300, 0]},
        {"profile": [300, 300]}, {"vignetting": [-900]}, {"intensity": True}, {"reach": "1"},
    ],
)  # fmt: skip
def test_a_flash_that_cannot_be_is_refused(slip, tmp_path):
    """Else photos are said to be too few, or numbers overflow."""
    (key,) = slip
    text = flash_text(Lamp(np.array([0.05, 0, 0]), widest=0.8, reach=1.0), {})
    (tmp_path / "flash.json").write_text(text)
    assert read_flash(tmp_path / "flash.json").reach == 1
    (tmp_path / "flash.json").write_text(json.dumps(json.loads(text) | slip))
    with pytest.raises(
        InputError, match=f"flash.json: {key} (= .* cannot be of a flash|is not as)"
    ):
        read_flash(tmp_path / "flash.json")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ([], "give --wall"),
        (["--wall", "nowhere", "--square", "0.03"], "no folder of photos"),
        (["--wall", "photos", "--square", "0"], "is no length"),
        (["--wall", "photos", "--square", "1", "--reflectance", "2"], "not between 0 and 1"),
        (["--board", "board.jpg"], "written as png"),
    ],
)
def test_what_is_missing_is_named(given, said, project_folder, capsys):
    assert main(["calibrate-flash", str(project_folder), *given]) != 0
    assert said in capsys.readouterr().err


def test_the_board_is_written(project_folder, tmp_path, capsys):
    board = tmp_path / "board.png"
    assert main(["calibrate-flash", str(project_folder), "--board", str(board)]) == 0
    with Image.open(board) as picture:
        assert picture.size == (1400, 1000)

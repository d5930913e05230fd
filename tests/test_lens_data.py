"""Lenses that EXIF names: their distortion from lensfun's database, as a start."""

from dataclasses import replace

import lensfunpy
import numpy as np
import pytest
from PIL import Image
from raw_files import write_dng

from texproj.camera import Intrinsics
from texproj.formats.photos import read_photo, read_photo_info
from texproj.formats.photos.header import header_of
from texproj.formats.photos.lens_data import known_lens
from texproj.options import DevelopOptions, PointsOptions
from texproj.register.picks.lens import lens_guess

CANON = ("Canon", "Canon EOS 5D Mark II", "EF24-105mm f/4L IS USM")


def photo(path, size=(600, 400), camera=CANON, focal_mm=24.0, f_number=8.0):
    exif = Image.Exif()
    exif[271], exif[272] = camera[:2]
    exif[0x8769] = {
        0xA434: camera[2],
        0x920A: focal_mm,
        0xA405: round(focal_mm),
        0x829D: f_number,
    }
    Image.new("RGB", size).save(path, exif=exif)
    return read_photo_info(path)


@pytest.mark.parametrize("size", [(600, 400), (400, 600)])
def test_a_known_lens_starts_with_its_distortion(size, tmp_path):
    """Points over the picture fall where lensfun itself puts them, up to the scale that it and
    EXIF's focal length leave open, within a thousandth of the diagonal; upright and across.
    """
    info = photo(tmp_path / "a.jpg", size)
    assert "EF 24-105mm f/4L IS USM" in info.notes[-1]
    body = lensfunpy.Database().find_cameras(*CANON[:2])[0]
    lens = lensfunpy.Database().find_lenses(body, None, CANON[2])[0]
    modifier = lensfunpy.Modifier(lens, body.crop_factor, 600, 400)
    modifier.initialize(24.0, 8.0, 1000.0, flags=lensfunpy.ModifyFlags.DISTORTION)
    wanted = modifier.apply_geometry_distortion(0, 0, 600, 400).reshape(-1, 2) - (300, 200)
    x, y = np.meshgrid(np.arange(600) - 300.0, np.arange(400) - 200.0)
    ideal = np.stack([x.ravel(), y.ravel()], axis=1) / info.focal_px
    ours = Intrinsics(600, 400, 1, 1, 0, 0, info.distortion).distort(ideal) * info.focal_px
    scale = (ours * wanted).sum() / (ours**2).sum()
    assert np.abs(scale * ours - wanted).max() < 0.72
    assert np.abs(ideal * info.focal_px * scale - wanted).max() > 5


def test_picks_start_from_it(tmp_path):
    info = photo(tmp_path / "a.jpg")
    lens = lens_guess(info, None, PointsOptions())
    assert lens.intrinsics.dist == info.distortion
    (k1,) = [prior.value for prior in lens.priors if prior.name == "k1"]
    assert k1 == info.distortion[0] < -0.03


@pytest.mark.parametrize(
    "camera",
    [("Canon", "Canon EOS 5D Mark II", "no such lens"), ("X", "Y", CANON[2]), ("", "", "")],
)
def test_unknown_lenses_start_straight(camera, tmp_path):
    info = photo(tmp_path / "a.jpg", camera=camera)
    assert info.distortion == ()
    assert not any("lensfun" in note for note in info.notes)
    assert lens_guess(info, None, PointsOptions()).intrinsics.dist == (0.0,) * 5


def test_a_focal_length_that_the_lens_does_not_have_is_another_lens(tmp_path):
    assert photo(tmp_path / "a.jpg", focal_mm=300.0).distortion == ()


# --- light


def raw_photo(tmp_path, rgb):
    """A DNG of what the sensor saw, its info and its picture in linear light."""
    path = write_dng(tmp_path / "a.dng", rgb)
    return path, read_photo_info(path)


def by_lensfun(size, f_number):
    """(h, w) light over that in the middle, by lensfun itself."""
    database = lensfunpy.Database()
    body = database.find_cameras(*CANON[:2])[0]
    lens = database.find_lenses(body, None, CANON[2])[0]
    modifier = lensfunpy.Modifier(lens, body.crop_factor, *size)
    flags = lensfunpy.ModifyFlags.VIGNETTING
    modifier.initialize(24.0, f_number, 1000.0, pixel_format=np.float32, flags=flags)
    white = np.ones((size[1], size[0], 3), np.float32)
    assert modifier.apply_color_modification(white)
    return 1 / white[..., 1]


@pytest.mark.parametrize("f_number", [4.0, 8.0])
def test_the_light_that_a_known_lens_loses(f_number, tmp_path):
    """As lensfun has it, within 1 % of the light in the middle; a JPEG is left alone."""
    info = photo(tmp_path / "a.jpg", f_number=f_number)
    assert info.lens_light == ()
    with (tmp_path / "a.jpg").open("rb") as file:
        known = known_lens(header_of(tmp_path / "a.jpg", file, 10), info.focal_px)
    wanted = by_lensfun((600, 400), f_number)
    x, y = np.arange(600) + 0.5 - 300, np.arange(400) + 0.5 - 200
    r2 = (x**2 + y[:, None] ** 2) / (300**2 + 200**2)
    ours = 1 + sum(term * r2 ** (n + 1) for n, term in enumerate(known.lens_light))
    assert np.abs(ours - wanted).max() < 0.01
    assert wanted.min() < 0.3


def test_a_raw_file_gets_its_light_back(tmp_path):
    """An even wall, as a lens that loses three quarters in the corner shows it, is even again;
    not where the setting says so.
    """
    size, terms = (96, 64), (-0.8, 0.2, -0.15)
    x, y = np.arange(size[0]) + 0.5 - 48, np.arange(size[1]) + 0.5 - 32
    r2 = (x**2 + y[:, None] ** 2) / (48**2 + 32**2)
    light = 1 + sum(term * r2 ** (n + 1) for n, term in enumerate(terms))
    path, info = raw_photo(tmp_path, np.repeat(0.6 * light[..., None], 3, axis=2))
    assert info.lens_light == ()
    known = replace(info, lens_light=terms)
    even = read_photo(path, known).pixels[4:-4, 4:-4]
    assert np.abs(even / 0.6 - 1).max() < 0.01
    left = read_photo(path, known, develop=DevelopOptions(lens_light=False)).pixels
    np.testing.assert_array_equal(left, read_photo(path, info).pixels)
    assert left[6, 6].max() < 0.3

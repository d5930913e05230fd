"""Lenses that EXIF names: their distortion from lensfun's database, as a start."""

import lensfunpy
import numpy as np
import pytest
from PIL import Image

from texproj.camera import Intrinsics
from texproj.formats.photos import read_photo_info
from texproj.options import PointsOptions
from texproj.register.picks.lens import lens_guess

CANON = ("Canon", "Canon EOS 5D Mark II", "EF24-105mm f/4L IS USM")


def photo(path, size=(600, 400), camera=CANON, focal_mm=24.0, **tags):
    exif = Image.Exif()
    exif[271], exif[272] = camera[:2]
    exif[0x8769] = {
        0xA434: camera[2],
        0x920A: focal_mm,
        0xA405: round(focal_mm),
        0x829D: 8.0,
        **tags,
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

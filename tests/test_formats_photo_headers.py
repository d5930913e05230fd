"""What photo headers tell: focal length, exposure, camera; and what is said when they do not."""

import math

import numpy as np
import pytest
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from texproj.formats.photos import read_photo_info

MAKE, MODEL, ORIENTATION, SOFTWARE, EXIF = 271, 272, 274, 305, 0x8769
TIME, F_NUMBER, ISO, FOCAL, FOCAL_35MM, SERIAL = 0x829A, 0x829D, 0x8827, 0x920A, 0xA405, 0xA431
WIDTH, HEIGHT, PLANE_X, PLANE_UNIT = 0xA002, 0xA003, 0xA20E, 0xA210
DIAGONAL_MM = math.hypot(36, 24)


def info_of(tmp_path, photo=None, main=None, size=(300, 200), name="a.jpg"):
    """The info of a photo of `size` with these EXIF tags."""
    exif = Image.Exif()
    if photo is not None:
        exif.update({SOFTWARE: "none"} | (main or {}))
        exif.get_ifd(EXIF).update(photo)
        if name.endswith(".tif"):
            exif[EXIF] = photo  # how Pillow writes it there
    Image.new("RGB", size, (9, 99, 199)).save(tmp_path / name, exif=exif)
    return read_photo_info(tmp_path / name)


@pytest.mark.parametrize("name", ["a.jpg", "a.png", "a.tif"])
def test_the_35_mm_equivalent_counts_over_the_diagonal(tmp_path, name):
    """A 50 mm lens on 36 x 24 mm: 300 pixels over 36 mm."""
    info = info_of(tmp_path, {FOCAL_35MM: 50}, name=name)
    assert info.focal_px == pytest.approx(50 * 300 / 36)
    assert info.notes == ()
    square = info_of(tmp_path, {FOCAL_35MM: 50}, size=(300, 300), name=name)
    assert square.focal_px == pytest.approx(50 / DIAGONAL_MM * math.hypot(300, 300))


@pytest.mark.parametrize(("unit", "mm"), [(2, 25.4), (3, 10), (4, 1), (5, 0.001), (None, 25.4)])
def test_the_focal_plane_resolution_in_every_unit(tmp_path, unit, mm):
    """A pixel of 1/100 mm and a lens of 35 mm: 3500 pixels."""
    per_unit = IFDRational(round(100 * mm * 1000), 1000)
    photo = {FOCAL: IFDRational(35), PLANE_X: per_unit}
    if unit:
        photo[PLANE_UNIT] = unit
    assert info_of(tmp_path, photo).focal_px == pytest.approx(3500, rel=1e-5)


def test_the_finer_of_two_that_agree_is_used_and_the_safer_of_two_that_do_not(tmp_path):
    """The 35 mm equivalent is rounded to whole millimetres; the plane resolution may be bogus."""
    fine = {FOCAL: IFDRational(35), PLANE_X: IFDRational(12), PLANE_UNIT: 4}  # 420 px
    agree = info_of(tmp_path, fine | {FOCAL_35MM: 50})  # 416.7 px
    assert agree.focal_px == pytest.approx(420)
    assert agree.notes == ()
    differ = info_of(tmp_path, fine | {FOCAL_35MM: 80})
    assert differ.focal_px == pytest.approx(80 * 300 / 36)
    assert any("disagree" in note for note in differ.notes)


def test_a_reduced_photo_keeps_its_field_of_view(tmp_path):
    """The focal plane speaks of 3000 pixels, the file has 300."""
    photo = {FOCAL: IFDRational(35), PLANE_X: IFDRational(100), PLANE_UNIT: 4}
    info = info_of(tmp_path, photo | {WIDTH: 3000, HEIGHT: 2000})
    assert info.focal_px == pytest.approx(350)
    assert info.notes == ()


def test_a_cropped_photo_keeps_its_pixels_and_is_noted(tmp_path):
    info = info_of(tmp_path, {FOCAL_35MM: 50, WIDTH: 600, HEIGHT: 400}, size=(380, 300))
    assert info.focal_px == pytest.approx(50 * 600 / 36)
    assert any("600 x 400" in note and "cropped" in note for note in info.notes)


@pytest.mark.parametrize("orientation", [1, 3, 6, 8])
def test_a_turned_photo_has_the_same_focal_length_and_swapped_sides(tmp_path, orientation):
    photo = {FOCAL_35MM: 50, WIDTH: 300, HEIGHT: 200}
    info = info_of(tmp_path, photo, {ORIENTATION: orientation})
    assert (info.width, info.height) == ((200, 300) if orientation >= 5 else (300, 200))
    assert info.focal_px == pytest.approx(50 * 300 / 36)
    assert info.notes == ()


def test_a_photo_stored_upright_by_an_editor_is_not_a_crop(tmp_path):
    """Pixels turned, EXIF sizes left as they were."""
    info = info_of(tmp_path, {FOCAL_35MM: 50, WIDTH: 300, HEIGHT: 200}, size=(200, 300))
    assert info.focal_px == pytest.approx(50 * 300 / 36)
    assert info.notes == ()


def test_exposure_is_the_light_gathered_in_stops(tmp_path):
    """Twice the time, twice the ISO, or 1/sqrt(2) of the f-number: one stop each."""
    base = {TIME: IFDRational(1, 100), F_NUMBER: IFDRational(8), ISO: 100}
    ev = info_of(tmp_path, base).exposure_ev
    assert ev == pytest.approx(math.log2(0.01 / 64))
    assert info_of(tmp_path, base | {ISO: 200}).exposure_ev == pytest.approx(ev + 1)
    assert info_of(tmp_path, base | {TIME: IFDRational(1, 50)}).exposure_ev == pytest.approx(ev + 1)
    assert info_of(tmp_path, base | {F_NUMBER: IFDRational(4)}).exposure_ev == pytest.approx(ev + 2)
    for tag in base:
        rest = {key: value for key, value in base.items() if key != tag}
        assert info_of(tmp_path, rest).exposure_ev is None


BODIES = {
    "Canon EOS 5D 0123": ({MAKE: "Canon", MODEL: "Canon EOS 5D"}, {SERIAL: "0123"}),
    "NIKON CORPORATION NIKON D90": ({MAKE: "NIKON CORPORATION", MODEL: "NIKON D90"}, {}),
    "Apple iPhone 15": ({MAKE: "Apple\0", MODEL: "iPhone 15 "}, {}),
    "X100V": ({MODEL: "X100V"}, {}),
    "": ({}, {ISO: 100}),
}


@pytest.mark.parametrize("name", BODIES)
def test_the_camera_body_is_maker_model_and_serial(tmp_path, name):
    main, photo = BODIES[name]
    assert info_of(tmp_path, photo, main).camera_body == name


def test_a_photo_without_exif_says_so_once(tmp_path):
    info = info_of(tmp_path)
    assert (info.focal_px, info.exposure_ev, info.camera_body) == (None, None, "")
    assert len(info.notes) == 1
    assert "no EXIF" in info.notes[0]


@pytest.mark.parametrize(
    "photo",
    [
        {FOCAL_35MM: 0},
        {FOCAL: IFDRational(0, 0), PLANE_X: IFDRational(100), PLANE_UNIT: 4},
        {FOCAL: IFDRational(35), PLANE_X: IFDRational(1, 0), PLANE_UNIT: 4},
        {FOCAL: IFDRational(35), PLANE_X: IFDRational(100), PLANE_UNIT: 77},
        {FOCAL: IFDRational(35)},
    ],
    ids=["unknown", "0/0", "1/0", "unit", "no plane"],
)
def test_numbers_that_mean_nothing_are_no_focal_length(tmp_path, photo):
    info = info_of(tmp_path, photo | {TIME: IFDRational(0, 0), F_NUMBER: 0, ISO: 100})
    assert info.focal_px is None
    assert info.exposure_ev is None
    assert any("no focal length" in note for note in info.notes)


def test_a_broken_exif_block_is_no_reason_to_refuse_a_photo(tmp_path):
    """Every single byte of the block spoiled in turn: the size is still told, without a warning."""
    info_of(tmp_path, {FOCAL_35MM: 50}, {MAKE: "Canon", ORIENTATION: 1})
    data = (tmp_path / "a.jpg").read_bytes()
    start = data.index(b"Exif\0\0") + 6
    length = int.from_bytes(data[start - 8 : start - 6], "big") - 8
    rng = np.random.default_rng(0)
    for at in range(start, start + length):
        spoiled = bytearray(data)
        spoiled[at] = rng.integers(256)
        (tmp_path / "b.jpg").write_bytes(spoiled)
        info = read_photo_info(tmp_path / "b.jpg")
        assert sorted((info.width, info.height)) == [200, 300]


def test_the_exif_block_of_a_png_may_follow_its_pixels(tmp_path):
    info_of(tmp_path, {FOCAL_35MM: 50}, name="a.png")
    data = (tmp_path / "a.png").read_bytes()
    at = data.index(b"eXIf") - 4
    end = at + 12 + int.from_bytes(data[at : at + 4], "big")
    (tmp_path / "b.png").write_bytes(data[:at] + data[end:-12] + data[at:end] + data[-12:])
    assert read_photo_info(tmp_path / "b.png").focal_px == pytest.approx(50 * 300 / 36)


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif"])
def test_no_pixel_is_decoded_for_a_header(tmp_path, suffix):
    """Nine tenths of the file may be missing."""
    noise = np.random.default_rng(0).integers(0, 256, (300, 400, 3)).astype(np.uint8)
    path = tmp_path / f"a{suffix}"
    Image.fromarray(noise).save(path)
    data = path.read_bytes()
    if suffix == ".tif":
        assert int.from_bytes(data[4:8], "little") < 100
    path.write_bytes(data[: len(data) // 10])
    info = read_photo_info(path)
    assert (info.width, info.height) == (400, 300)


def test_a_panorama_of_many_megapixels_is_no_attack(tmp_path):
    """Pillow refuses headers of more than 179 megapixels unless told otherwise."""
    Image.new("1", (20_000, 10_000)).save(tmp_path / "a.png")
    info = read_photo_info(tmp_path / "a.png")
    assert (info.width, info.height) == (20_000, 10_000)

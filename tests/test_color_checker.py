"""Absolute color from a chart, on photographs of a chart whose colors are known on paper."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from chart_scenes import CHART, chart_at, chart_photo, true_linear, true_matrix
from color_scenes import camera, pattern, picture, plane
from photo_sets import photo_set
from skimage.color import deltaE_ciede2000, xyz2lab

from texproj.color.balance.corrections import Correction
from texproj.color.checker.apply import light_at
from texproj.color.checker.fit import (
    REFERENCE_LAB,
    XYZ_OF_SRGB,
    Checker,
    lab_of_srgb,
    p95,
    read_checker,
    srgb_of_lab,
)
from texproj.color.patches.texture import PatchSettings, color_patches
from texproj.color.texture import color_texture
from texproj.color.vertices import color_vertices
from texproj.errors import InputError
from texproj.formats.photos import read_photo, read_photo_info
from texproj.options import ColorOptions, RenderOptions
from texproj.photo import Photo, PhotoInfo, linear_from_srgb
from texproj.project import Project
from texproj.render import open_renderer
from texproj.stages.checking import checker_of
from texproj.stages.coloring import _inputs

WRONG = {"exposure": 0.45, "white_balance": (1.3, 1.0, 0.6)}

# --- colors on paper


def test_lab_and_back_are_those_of_another_library():
    linear = np.random.default_rng(0).random((200, 3)) ** 3
    xyz = linear @ XYZ_OF_SRGB.T
    lab = xyz2lab(xyz[None], illuminant="D50")[0]
    np.testing.assert_allclose(lab_of_srgb(linear), lab, atol=0.01)
    np.testing.assert_allclose(srgb_of_lab(lab_of_srgb(linear)), linear, atol=1e-12)


def test_the_table_is_that_of_the_chart():
    """Typed twice, converted by other matrices: the same linear light."""
    np.testing.assert_allclose(srgb_of_lab(REFERENCE_LAB), CHART, atol=2e-4)


# --- one photo


def other_colors(count=300):
    """Colors that the chart does not have, as CIELAB, all inside sRGB."""
    rng = np.random.default_rng(5)
    lab = rng.uniform((20, -45, -45), (90, 45, 45), (8 * count, 3))
    linear = true_linear(lab)
    inside = ((linear > 0.01) & (linear < 0.95)).all(axis=1)
    return lab[inside][:count]


@pytest.mark.parametrize(
    "light",
    [
        {},
        WRONG,
        {"exposure": 0.5, "white_balance": (0.7, 1.0, 1.5)},
        WRONG | {"falloff": (0.12, 0.1)},
        {"exposure": 0.5, "noise": 0.03},
    ],
    ids=["mild", "warm", "cool", "uneven", "noisy"],
)
def test_a_wrong_photo_is_put_right(light):
    """Colors that are not on the chart, through the same camera: CIEDE2000 against the truth, far
    below what it was, yet not below what noise and 8 bits leave.
    """
    checker = read_checker(chart_photo(**light))
    known = {k: v for k, v in light.items() if k in ("exposure", "white_balance")}
    lab = other_colors()
    seen = true_linear(lab) @ np.linalg.inv(true_matrix(**known)).T
    error = deltaE_ciede2000(xyz2lab((seen @ checker.matrix.T @ XYZ_OF_SRGB.T), "D50"), lab)
    wrong = deltaE_ciede2000(xyz2lab((seen @ XYZ_OF_SRGB.T), "D50"), lab)
    assert len(lab) == 300
    assert 0.02 < np.median(error) < 0.5
    assert p95(error) < 0.8
    assert np.median(wrong) > 5
    assert 0.05 < np.median(checker.after) < np.median(checker.left_out) < 1
    assert np.median(checker.before) > 5


def test_light_that_falls_off_over_the_chart_is_told():
    """Patches lie 2.5 by 1.5 apart, from middle to middle."""
    checker = read_checker(chart_photo(falloff=(0.15, -0.1)))
    assert checker.falloff == pytest.approx(np.exp(0.15 * 2.5 + 0.1 * 1.5), rel=0.02)
    assert read_checker(chart_photo()).falloff == pytest.approx(1, abs=0.02)


@pytest.mark.parametrize("turn", [-170.0, -90.0, 35.0, 90.0, 180.0])
def test_the_chart_may_lie_in_any_direction(turn):
    checker = read_checker(chart_photo(turn_deg=turn, width=0.4))
    assert np.median(checker.after) < 0.6


def test_a_chart_of_a_seventh_of_the_width_is_found():
    assert np.median(read_checker(chart_photo(width=0.15, size=(1920, 1440))).after) < 0.6


def test_tone_curves_are_told_by_the_figures():
    """A camera's S-shaped curve cannot be undone by a matrix: the remainder is there to see."""

    def curve(v):
        bent = np.where(v < 0.5, 2 * v * v, 1 - 2 * (1 - v) ** 2)
        return 0.5 * bent + 0.5 * v

    checker = read_checker(chart_photo(exposure=0.6, tone=curve))
    assert 1.5 < np.median(checker.after) < 5


# --- what is refused


def scrambled(x, y):
    """The same chart with its rows in another order."""
    return np.where(np.abs(y)[..., None] < 1.05, chart_at(x, np.where(y > 0, y - 1, y + 1)), 0.03)


def covered(x, y):
    """A sheet of paper over half of the chart."""
    out = chart_at(x, y)
    out[(x > -0.2) & (x < 2)] = 0.7
    return out


@pytest.mark.parametrize(
    ("photo", "words"),
    [
        ({"scene": lambda x, y: np.stack([0.2 + 0 * x, 0.3 + 0.1 * np.sin(9 * x), y * y / 9], -1)},
         "no 24-patch color chart.*`gray` in .light"),
        ({"offset": (0.3, 0.0)}, "cut off|no 24-patch"),
        ({"exposure": 1.6}, r"[1-9] patches .* over-exposed"),
        ({"exposure": 0.02, "noise": 0.001}, "too dark|no 24-patch"),
        ({"width": 0.04}, "no 24-patch|too small"),
        ({"scene": scrambled}, "cannot be corrected|no 24-patch"),
        ({"scene": covered}, "cannot be corrected|no 24-patch"),
    ],
    ids=["none", "cut", "clipped", "dark", "small", "scrambled", "covered"],
)  # fmt: skip
def test_what_cannot_be_trusted_is_refused_in_one_sentence(photo, words):
    with pytest.raises(InputError, match=words) as refused:
        read_checker(chart_photo(**photo))
    assert str(refused.value).startswith("chart.jpg: ")


# --- the model


VIEWS = ((0.3, 0.2, 3.0), (-0.9, 0.4, 2.8), (0.8, -0.7, 2.6), (-0.2, -0.9, 3.1))
EXPOSURES = np.array([[0.8, 0.8, 0.8], [1.3, 1.2, 1.1], [0.55, 0.6, 0.65], [1.0, 0.9, 1.1]])


@pytest.fixture(scope="module")
def renderer():
    with open_renderer(RenderOptions(renderer="cpu")) as renderer:
        yield renderer


def checker(matrix, photo=None, **info):
    """What a chart's photo would say."""
    some = np.ones(24)
    return Checker(
        np.asarray(matrix, float), PhotoInfo("c.jpg", 9, 9, **info), some, some, some, 1.0, photo
    )


def vertices(renderer, chart, exposures=EXPOSURES, infos=None):
    """Colors of the plane's vertices, the truth there, and the report's figures."""
    mesh, cameras = plane(), [camera(c) for c in VIEWS]
    photos = [picture(c, gain=e) for c, e in zip(cameras, exposures, strict=True)]
    if infos:
        photos = [replace(p, info=replace(p.info, **i)) for p, i in zip(photos, infos, strict=True)]
    result = color_vertices(mesh, photo_set(cameras, photos), renderer, checker=chart)
    sure = result.photo_count > 1
    truth = pattern(mesh.vertices[:, 0], mesh.vertices[:, 1])
    return result.rgb[sure], truth[sure], result.quality


@pytest.mark.parametrize("index", [0, 2])
def test_the_charts_photo_among_the_others_ties_the_model_to_absolute_light(renderer, index):
    """The plane's own colors, whatever exposure and white balance each photo has."""
    chart = checker(np.diag(1 / EXPOSURES[index]), str(index))
    rgb, truth, quality = vertices(renderer, chart)
    assert np.abs(rgb / truth - 1).max() < 0.02
    assert quality["checker"]["exposure"] == "the chart's photo is one of the model's"
    assert quality["checker"]["exposure_known"]
    plain, _, none = vertices(renderer, None)
    assert np.abs(plain / truth - 1).min() > 0.04
    assert "checker" not in none


def test_the_charts_place_in_a_photo_that_is_dark_in_the_corners_counts():
    """A photo's light is multiplied by 1.5 at the chart: what is absolute there stays so."""
    grid = np.ones((10, 20), np.float32)
    grid[7, 18] = 1.5
    assert light_at(Correction(light=grid), (0.93, 0.71)) == 1.5
    assert light_at(Correction(light=grid), (0.1, 0.71)) == 1
    assert light_at(Correction(light=grid), (1.0, 1.0)) == 1
    assert light_at(Correction(), (0.9, 0.7)) == 1
    assert read_checker(chart_photo(offset=(0.1, -0.1))).place == pytest.approx(
        (0.6, 0.37), abs=0.03
    )


def test_a_matrix_mixes_the_channels_of_the_blend(renderer):
    mixing = np.array([[0.8, 0.2, 0.0], [0.1, 0.7, 0.2], [0.0, 0.3, 0.7]])
    rgb, truth, _ = vertices(renderer, checker(mixing @ np.diag(1 / EXPOSURES[1]), "1"))
    np.testing.assert_allclose(rgb, truth @ mixing.T, rtol=0.02)


def test_exif_ties_a_chart_of_its_own_photo(renderer):
    """Photos gather 2^EV of the light, the chart's photo twice as much as the first."""
    ev = np.array([9.0, 9.7, 8.4, 9.2])
    infos = [{"camera_body": "A", "exposure_ev": e} for e in ev]
    exposures = np.repeat(2.0 ** (ev - 9.0)[:, None], 3, axis=1) * 0.7
    chart = checker(np.eye(3) / (0.7 * 2), camera_body="A", exposure_ev=10.0)
    rgb, truth, quality = vertices(renderer, chart, exposures, infos)
    assert np.abs(rgb / truth - 1).max() < 0.02
    assert quality["checker"]["exposure"] == "EXIF exposure, 4 photos of the same camera"


def test_without_a_tie_only_the_hues_change(renderer):
    """Another camera: the luminance of white stays, the cast goes."""
    cast = np.array([1.2, 1.0, 0.7])
    chart = checker(np.diag(1 / cast) * 3, camera_body="B", exposure_ev=3.0)
    exposures = np.tile(cast, (4, 1))
    rgb, truth, quality = vertices(renderer, chart, exposures)
    ratio = rgb / truth
    np.testing.assert_allclose(ratio, np.median(ratio), rtol=0.02)
    luminance = XYZ_OF_SRGB[1]
    assert np.median(ratio) == pytest.approx(1 / (luminance @ (1 / cast)), rel=0.02)
    assert quality["checker"]["exposure"].startswith("none")
    assert not quality["checker"]["exposure_known"]


@pytest.mark.parametrize("mode", ["texture", "patches"])
@pytest.mark.parametrize("bits", [8, 16])
def test_textures_are_absolute_too(renderer, mode, bits):
    """The mean of the page's seen texels against the mean of the plane."""
    mesh, cameras = plane(), [camera(c) for c in VIEWS]
    photos = [picture(c, gain=e) for c, e in zip(cameras, EXPOSURES, strict=True)]
    chart, options = checker(np.diag(1 / EXPOSURES[0]), "0"), ColorOptions(bits=bits)
    shown = photo_set(cameras, photos)
    if mode == "texture":
        texture = color_texture(mesh, shown, renderer, options, checker=chart)
    else:
        texture = color_patches(mesh, shown, renderer, PatchSettings(options), chart)
    seen = texture.photo_count[0] > 0
    page = linear_from_srgb(texture.pages[0][seen] / (2**bits - 1))
    x, y = np.meshgrid(np.linspace(-1, 1, 201), np.linspace(-1, 1, 201))
    np.testing.assert_allclose(page.mean(axis=0), pattern(x, y).mean(axis=(0, 1)), rtol=0.04)
    assert texture.quality["checker"]["file"] == "c.jpg"


# --- the project


def with_chart(folder, named):
    project = Project.open(folder)
    options = replace(project.settings.color, checker=named)
    return project.with_settings(replace(project.settings, color=options))


def test_the_project_reads_the_chart_and_a_new_one_makes_the_model_stale(project_folder):
    cv2.imwrite(str(project_folder / "chart.png"), chart_photo(**WRONG).pixels[..., ::-1])
    project = with_chart(project_folder, "chart.png")
    chart = checker_of(project)
    assert chart.photo is None and chart.info.name == "chart.png"
    np.testing.assert_allclose(chart.matrix, true_matrix(**WRONG), atol=0.05)
    before = _inputs(project)
    cv2.imwrite(str(project_folder / "chart.png"), chart_photo(seed=3).pixels[..., ::-1])
    after = _inputs(with_chart(project_folder, "chart.png"))
    assert {name for name in after if before[name] != after[name]} == {"color chart"}


def test_a_chart_in_a_photo_of_the_model_is_known_as_such(project_folder):
    names = Project.open(project_folder).photo_names
    path = project_folder / "photos" / names[1]
    cv2.imwrite(str(path), chart_photo().pixels[..., ::-1])
    project = with_chart(project_folder, f"photos/{names[1]}")
    assert checker_of(project).photo == names[1]


def test_a_missing_chart_is_named(project_folder):
    project = with_chart(project_folder, "nowhere.jpg")
    with pytest.raises(InputError, match=r"nowhere\.jpg; correct `checker` in \[color\]"):
        checker_of(project)
    assert checker_of(with_chart(project_folder, None)) is None


@pytest.mark.parametrize("shape", [(1, 1), (4, 3000), (60, 80), (400, 600)])
def test_pictures_without_a_chart_are_refused_whatever_their_shape(shape):
    noise = np.random.default_rng(0).integers(0, 256, (*shape, 3)).astype(np.uint8)
    with pytest.raises(InputError, match="no 24-patch color chart"):
        read_checker(Photo(PhotoInfo("n.png", shape[1], shape[0]), noise))


def test_real_photos_without_a_chart_are_refused(real_data):
    """Some facades look like charts to a detector; their colors do not."""
    for path in sorted((real_data("sceaux-castle") / "photos").iterdir())[:2]:
        with pytest.raises(InputError, match=r"no 24-patch|cannot be corrected|exposed"):
            read_checker(read_photo(path, read_photo_info(path)))

"""Photometric units, colors of light and sources against published numbers."""

import numpy as np
import pytest

from texproj.appearance.harmonics import OPEN_GAINS, basis
from texproj.appearance.light.color_temperature import (
    daylight_xy,
    planck_xy,
    rgb_of_kelvin,
    rgb_of_xy,
)
from texproj.appearance.light.exposure_value import (
    brightest_luminance,
    ev_of_illuminance,
    ev_of_luminance,
    ev_of_settings,
    illuminance_of_ev,
    luminance_of_ev,
)
from texproj.appearance.light.ies import ies_of_text
from texproj.appearance.light.sources import (
    Directional,
    Environment,
    Point,
    Spot,
    candela_of_lumens,
    candela_of_spot,
    disk,
    luminance_of_area,
    rectangle,
)
from texproj.errors import InputError
from texproj.photo import LUMINANCE

UP = np.array([[0, 0, 1.0]])
HERE = np.zeros((1, 3))


def test_exposure_values_are_those_of_the_tables():
    """Sunny 16; a meter's luminance and illuminance at EV 15 (ISO 2720); their inverses."""
    assert ev_of_settings(16, 1 / 100) == pytest.approx(14.64, abs=0.01)
    assert ev_of_settings(16, 1 / 400, 400) == pytest.approx(14.64, abs=0.01)
    assert luminance_of_ev(15) == 4096
    assert illuminance_of_ev(15) == pytest.approx(81_920)
    assert ev_of_luminance(4096) == 15
    assert ev_of_illuminance(81_920) == pytest.approx(15)
    assert brightest_luminance(0) == pytest.approx(1.2)
    with pytest.raises(ValueError, match="positive"):
        ev_of_settings(0, 1)


@pytest.mark.parametrize(
    ("kelvin", "expected"),
    [(2856, (0.4476, 0.4074)), (4000, (0.3805, 0.3768)), (1500, (0.5857, 0.3931)),
     (10_000, (0.2807, 0.2884))],
)  # fmt: skip
def test_black_bodies_have_their_chromaticity(kelvin, expected):
    """Illuminant A and others of Wyszecki and Stiles, table 1(3.11)."""
    assert planck_xy(kelvin) == pytest.approx(expected, abs=4e-4)


@pytest.mark.parametrize(
    ("kelvin", "expected"),
    [(6504, (0.3127, 0.3290)), (5003, (0.3457, 0.3585)), (7504, (0.2990, 0.3149))],
)
def test_daylight_has_its_chromaticity(kelvin, expected):
    """D65, D50 and D75 (CIE 15:2004)."""
    assert daylight_xy(kelvin) == pytest.approx(expected, abs=2e-4)


def test_colors_of_light():
    """D65 is white; warm is red, cold is blue, each of luminance 1; nothing is negative."""
    assert rgb_of_xy((0.3127, 0.3290)) == pytest.approx([1, 1, 1], abs=2e-3)
    rgb = rgb_of_kelvin([1200, 3000, 6504, 20_000])
    assert rgb @ LUMINANCE == pytest.approx(np.ones(4), abs=1e-6)
    assert (rgb >= 0).all()
    assert (np.diff(rgb[:, 0]) < 0).all()
    assert (np.diff(rgb[:, 2]) > 0).all()
    with pytest.raises(ValueError, match="1000 to 25000 K"):
        rgb_of_kelvin(500)


def test_lumens_candela_and_lux():
    """A point of 1000 lm, a spot that has all in a half sphere, a square metre of light."""
    lamp = Point(np.array([0, 0, 2.0]), candela_of_lumens(1000))
    assert lamp.irradiance(HERE, UP)[0] == pytest.approx([1000 / (4 * np.pi) / 4] * 3)
    assert candela_of_spot(1000, 90) == pytest.approx(1000 / (2 * np.pi))
    assert luminance_of_area(np.pi * 100, 1) == pytest.approx(100)
    assert Directional(np.array([0, 1, 1.0]), 100).irradiance(HERE, UP)[0, 0] == pytest.approx(
        100 / np.sqrt(2)
    )


def test_a_spot_lights_its_cone():
    """All within the inner angle, nothing beyond the outer one, the half of it squared between."""
    lamp = Spot(np.array([0, 0, 1.0]), np.array([0, 0, -1.0]), 100, 10, 30)
    at = np.tan(np.radians([0, 9, 31]))
    xyz = np.stack([at, 0 * at, 0 * at], axis=1)
    lux = lamp.irradiance(xyz, np.repeat(UP, 3, 0))[:, 0]
    bare = Point(lamp.place, 100).irradiance(xyz, np.repeat(UP, 3, 0))[:, 0]
    assert lux[:2] == pytest.approx(bare[:2])
    assert lux[2] == 0


@pytest.mark.parametrize("height", [0.1, 1.0, 10.0])
def test_a_disk_gives_what_the_textbook_says(height):
    """pi L r^2 / (r^2 + h^2) on its axis."""
    light = disk(np.array([0, 0, height]), np.array([0, 0, -1.0]), 1.0, 5.0)

    expected = np.pi * 5 / (1 + height**2)
    assert light.irradiance(HERE, UP)[0, 0] == pytest.approx(expected, rel=3e-3)
    assert (light.irradiance(HERE, -UP) == 0).all()
    behind = np.array([[0, 0, 2 * height]])
    assert (light.irradiance(behind, -UP) == 0).all()


def test_a_rectangle_is_the_sum_of_its_points():
    """Also where part of it is below the horizon."""
    center, x, y = np.array([0.3, 0.1, 0.5]), np.array([0.6, 0, 0.2]), np.array([0, -0.5, 0.1])
    light = rectangle(center, x, y, 2.0)
    normal = np.array([[0.8, 0.0, 0.6]])
    s = (np.arange(400) + 0.5) / 200 - 1
    u, v = (g.ravel() for g in np.meshgrid(s, s))
    xyz = center + u[:, None] * x + v[:, None] * y
    across = np.cross(x, y)
    far = np.linalg.norm(xyz, axis=1)
    d = xyz / far[:, None]
    leaving = np.maximum(-d @ across, 0)
    total = 2.0 * (np.maximum(d @ normal[0], 0) * leaving / far**2).sum() * 4 / len(u)

    assert (d @ normal[0]).min() < 0
    assert total > 0.01
    assert light.irradiance(HERE, normal)[0, 0] == pytest.approx(total, rel=2e-3)


def test_an_environment_of_one_radiance():
    """Gives pi of it to everything; its harmonics give the same."""
    around = Environment(np.full((32, 64, 3), 0.5))
    normals = np.array([[0, 0, 1.0], [1, 0, 0], [0, 0.6, -0.8]])

    lux = around.irradiance(np.zeros((3, 3)), normals)
    assert lux == pytest.approx(np.full((3, 3), 0.5 * np.pi), rel=2e-3)
    again = (basis(normals) * OPEN_GAINS) @ around.harmonics()
    assert again == pytest.approx(lux, rel=2e-3)


def test_an_environment_is_where_it_says():
    """A bright pixel is seen along its direction, and lights what faces it."""
    image = np.zeros((16, 32, 3))
    image[4, 8] = 1
    around = Environment(image)
    d, _ = around.pixels()
    sun = d[4 * 32 + 8]

    assert around.radiance(sun[None])[0] == pytest.approx([1, 1, 1])
    assert sun[1] > 0.6
    lux = around.irradiance(np.zeros((2, 3)), np.stack([sun, -sun]))
    assert lux[0, 0] > 0
    assert lux[1, 0] == 0


LAMP = """IESNA:LM-63-2002
[TEST] none
[MANUFAC] a maker
TILT=NONE
1 1000 1.0 3 2 1 2 0 0 0
1 1 50
0 45 90
0 90
100 50 10
200 60 10
"""


def test_an_ies_file_is_read():
    """By its symmetry, between its angles, and with nothing above the horizon, where it says
    nothing.
    """
    lamp = ies_of_text(LAMP)

    def towards(down, around):
        t, p = np.radians([down, around])
        return np.array([[np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), -np.cos(t)]])

    assert lamp.keywords["MANUFAC"] == "a maker"
    assert lamp.lumens == 1000
    for down, around, expected in (
        (45, 0, 50), (45, 90, 60), (45, 180, 50), (45, 270, 60), (22.5, 0, 75), (45, 45, 55),
        (45, 315, 55), (90, 30, 10), (100, 0, 0),
    ):  # fmt: skip
        assert lamp.intensity(towards(down, around))[0] == pytest.approx(expected), (down, around)
    below = Point(np.array([0, 0, 2.0]), 1.0, profile=lamp)
    assert below.irradiance(HERE, UP)[0, 0] == pytest.approx(100 / 4)


def test_flux_is_the_integral_of_intensity():
    """Of a lamp alike in all directions, with a tilt table, a multiplier and a ballast factor."""
    text = "TILT=INCLUDE\n1\n2\n0 90\n1 .9\n1 -1 2 2 1 1 2 0 0 0\n.5 1 10\n0 180\n0\n100 100\n"

    lamp = ies_of_text(text)

    assert lamp.lumens is None
    assert lamp.total_lumens == pytest.approx(4 * np.pi * 100, rel=1e-3)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("TILT=NONE", "", "no IES file"),
        ("TILT=NONE", "TILT=lamp.tlt", "names another file"),
        ("0 45 90", "0 90 45", "vertical angles do not rise"),
        ("200 60 10", "200 60", "are stated"),
        ("3 2 1 2", "3 2 2 2", "only type C"),
        ("100 50", "100 x", "could not convert"),
        ("100 50", "100 -1", "negative"),
        ("100 50", "100 nan", "not finite"),
        ("1.0 3 2", "1.0 0 2", "no number of angles"),
        ("1 1 50", "", "are stated"),
    ],
)
def test_a_broken_ies_file_ends_in_one_sentence(old, new, said):
    """That names the file and what is wrong."""
    assert old in LAMP
    with pytest.raises(InputError, match=said):
        ies_of_text(LAMP.replace(old, new), "lamp.ies")

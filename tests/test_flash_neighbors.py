"""Points under a flash that learn from others: whether they are metal, what their color is where
few photos see them, and what light comes from the surface around.
"""

import numpy as np
import pytest
import trimesh
from test_appearance_flash import one_point

from texproj.appearance.flash.bounce import FURTHER, Nodes, bounced, surface_hits
from texproj.appearance.flash.closed_form import model_terms
from texproj.appearance.flash.few_views import drawn_together
from texproj.appearance.flash.head_on import Witnesses
from texproj.appearance.flash.lamp import Lamp
from texproj.appearance.flash.observations import Flashes, LampShadows, Surfel
from texproj.appearance.flash.reflection import Material
from texproj.appearance.flash.voting import mesh_neighbors
from texproj.camera import Camera, Intrinsics, Pose
from texproj.render.rays import RayCaster

GOLD, STONE, LACQUER = (0.9, 0.65, 0.3), (0.5, 0.42, 0.35), (0.012, 0.011, 0.014)
STUFFS = Material(0.45, True), Material(0.8, False), Material(0.35, False)


def told(seen, *near):
    """What the point's neighbors, by number of `STUFFS`, say of it: cost of paint, of metal."""
    colors = np.array([(GOLD, STONE, LACQUER)[k] for k in near], np.float32)
    xyz = np.random.default_rng(1).uniform(-0.1, 0.1, (len(near), 3)).astype(np.float32)
    given = xyz, colors, np.array(near), np.ones(len(near), bool), STUFFS, 1.0
    terms = [model_terms(seen, stuff.values) for stuff in STUFFS]
    return Witnesses.of(*given).costs(np.zeros((1, 3), np.float32), seen, terms)[0]


def test_gold_off_its_highlight_is_no_black_paint():
    """It looks as black: but nearby there is stone and gold, and no black paint. Where it was seen
    head-on it would have shone, and where black paint is near nobody can tell.
    """
    dark = one_point(STUFFS[0], np.array(GOLD) / 3, nearest=0.8)
    assert dark.rgb.max() < 0.03

    paint, metal = told(dark, 0, 0, 1, 1)
    assert metal < paint - 1
    head_on = one_point(STUFFS[2], LACQUER)
    paint, metal = told(head_on, 0, 0, 1, 2)
    assert paint < metal - 1
    paint, metal = told(dark, 0, 0, 1, 2)
    assert abs(paint - metal) < 1


def test_without_a_metal_there_are_no_witnesses():
    """Nothing is called a metal by them."""
    rows = np.zeros((2, 3), np.float32), np.full((2, 3), 0.5, np.float32), np.array([1, 2])

    assert Witnesses.of(*rows, np.ones(2, bool), STUFFS, 1.0) is None
    assert Witnesses.of(*rows, np.zeros(2, bool), STUFFS, 1.0) is None


def grid(side=24):
    """Neighbors of points on a grid, and their places along it."""
    at = np.arange(side * side).reshape(side, side)
    one = np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:]], -1).reshape(-1, 3)
    other = np.stack([at[:-1, :-1], at[1:, 1:], at[:-1, 1:]], -1).reshape(-1, 3)
    return mesh_neighbors(np.concatenate([one, other]), side * side), at.ravel() % side


def test_what_few_photos_see_is_drawn_to_its_neighbors():
    """Points of one observation, a third off, come near to the truth; points that many see hardly
    move, and neither does a border between two paints, nor what is not free.
    """
    near, across = grid()
    rng = np.random.default_rng(0)
    truth = np.where(across[:, None] < 12, (0.5, 0.3, 0.2), (0.1, 0.2, 0.5)).astype(np.float32)
    truth *= np.exp(0.05 * rng.standard_normal((len(across), 1))).astype(np.float32)
    few = rng.random(len(across)) < 0.3
    number, none = np.where(few, 1, 12), np.zeros(len(across), int)
    shown = np.where(few[:, None], truth * np.exp(0.3 * rng.standard_normal((len(few), 1))), truth)

    def off(color):
        return np.abs(np.log(color / truth)).max(axis=1)

    drawn = drawn_together(shown.astype(np.float32), none, number, none == 0, near)
    assert np.median(off(drawn)[few]) < 0.4 * np.median(off(shown)[few])
    beside = ~few & (np.abs(across - 11.5) < 1)
    assert np.median(off(drawn)[beside]) < 0.06
    kept = drawn_together(shown.astype(np.float32), none, number, none > 0, near)
    assert kept == pytest.approx(shown, rel=1e-6)


def test_light_goes_to_and_fro_in_a_hollow():
    """In a white ball around the flash each bounce adds what the one before had, less the paint."""
    ball = trimesh.creation.icosphere(3, 1.0)
    xyz, inwards = np.asarray(ball.vertices, np.float32), np.asarray(ball.faces)[:, ::-1]
    camera = Camera(Intrinsics(4, 4, 4, 4, 2, 2), Pose.identity())
    lamp = Lamp(np.zeros(3), intensity=1.0)
    surfels = Surfel(xyz, -xyz)
    shadows = LampShadows(RayCaster(xyz, inwards), np.zeros(3), 1e-3)
    paint = np.full((len(xyz), 3), 0.6, np.float32)
    nodes = Nodes(surfels, paint, np.zeros(len(xyz), int), [Material(1.0, False, 0.0, 1.0)])

    light = bounced(
        nodes, surface_hits(shadows, surfels), Flashes.of([camera], lamp, [1]), lamp, shadows,
        np.ones((len(xyz), 1), bool),
    )  # fmt: skip

    assert FURTHER == 2
    assert np.median(light) == pytest.approx(0.6 + 0.36 + 0.216, rel=0.05)

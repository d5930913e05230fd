"""Views of photos on their way to the surface: made ahead, blind ones."""

import numpy as np
import pytest
from color_scenes import camera, joined, moved, picture, plane
from photo_sets import photo_set

from texproj.color.texture import color_texture
from texproj.options import ColorOptions, RenderOptions
from texproj.render import open_renderer
from texproj.resources.threads import ahead

BEHIND = (0.3, 0.2, -3.0)


@pytest.fixture(scope="module", params=["gl", "cpu"])
def renderer(request):
    with open_renderer(RenderOptions(renderer=request.param)) as renderer:
        yield renderer


def test_a_photo_that_sees_nothing_adds_nothing(renderer):
    """A photo from behind the surface colors none of it and disturbs no other photo."""
    centers = [(0.3, 0.2, 3.0), BEHIND, (-0.5, 0.1, 2.8)]
    cameras = [camera(center) for center in centers]
    photos = [picture(c) for c in cameras]
    texture = color_texture(plane(), photo_set(cameras, photos), renderer)
    assert texture.quality["seen"] > 0.9
    shares = [entry["share"] for entry in texture.quality["photos"]]
    assert shares[centers.index(BEHIND)] == 0


def test_a_renderer_works_after_a_rest(renderer):
    """A scene loaded after a rest shows what one before it showed; an open scene forbids rest."""
    view = camera((0.3, 0.2, 3.0))
    with renderer.load(plane()) as scene:
        renderer.rest()
        before = scene.gbuffer(view, ("depth",)).depth
    renderer.rest()
    renderer.rest()
    with renderer.load(plane()) as scene:
        np.testing.assert_array_equal(scene.gbuffer(view, ("depth",)).depth, before)


def test_ahead_keeps_order_and_distance():
    """Everything comes once and in order, never more than asked for is made before it is used."""
    used, most = [], []

    def make(number):
        most.append(number - len(used))
        return number

    for number in ahead(make, 20, 3):
        used.append(number)
    assert used == list(range(20))
    assert max(most) <= 3 + 1


def test_ahead_stops_at_the_first_failure():
    """An exception while making comes out where that item is due, and no more are made."""
    made = []

    def make(number):
        made.append(number)
        if number == 2:
            raise ValueError("third")
        return number

    got = []
    with pytest.raises(ValueError, match="third"):
        for number in ahead(make, 50, 3):
            got.append(number)
    assert got == [0, 1]
    assert len(made) < 10


@pytest.mark.parametrize("vignetting", ["auto", "on"])
def test_photos_that_share_nothing_are_colored(renderer, vignetting):
    """Photos of one lens that show different things have no common light: no failure."""
    places = (0.0, 8.0, 16.0)
    mesh = joined(*(moved(plane(), (x, 0, 0)) for x in places))
    cameras = [camera((0.2, 0.1, 3.0), offset=(x, 0, 0)) for x in places]
    photos = [picture(c) for c in cameras]
    options = ColorOptions(vignetting=vignetting)
    texture = color_texture(mesh, photo_set(cameras, photos), renderer, options)
    assert texture.quality["seen"] > 0.9
    assert not any(lens["corrected"] for lens in texture.quality["lenses"])

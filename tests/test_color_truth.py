"""Color of photos with all usual defects against the truth, on a synthetic piece."""

import cv2
import numpy as np
import pytest
from color_synthetic import colored
from color_truth import (
    COARSE,
    made,
    picture_errors,
    surface_errors,
    true_points,
    true_views,
)
from photo_sets import photo_set
from scenes import Defects

from texproj.color.occluders.in_front import find_occluders
from texproj.mesh import ColoredMesh
from texproj.options import ColorOptions, RenderOptions
from texproj.photo import srgb_from_linear
from texproj.render import open_renderer

PLAIN = ColorOptions(gains=False, vignetting="off", focus_power=0, blend="mean")
"""Nothing is corrected: the weighted mean of the photos as they are."""


@pytest.fixture(scope="module")
def renderer():
    with open_renderer(RenderOptions()) as renderer:
        yield renderer


@pytest.fixture(scope="module")
def data():
    return made(Defects())[0]


@pytest.fixture(scope="module")
def textured(data, renderer):
    return in_a_new_picture(colored("texture", data, renderer), renderer)


def in_a_new_picture(model, renderer):
    return picture_errors(model, true_views(True, samples=3, count=1), renderer)


def test_texture_is_near_the_truth(textured):
    """From a place where no photo was taken the texture looks like the piece, in spite of exposure
    steps, vignetting, a visitor, a blurred photo and a highlight; what remains is more than
    nothing, since photos and scan have noise and a limited resolution: of this scan's edges, 9 mm
    or three pixels long, alone come 5 of the 95 %.
    """
    assert 0.5 < textured.median < 1.5
    assert 2.0 < textured.p95 < 6.5
    assert textured.share > 0.98


def test_the_visitor_is_cut_out_and_nothing_else(data, renderer):
    """Of what the visitor hides nothing is left but the outermost edge, of the photo's other area
    less than 2 % is lost, and in the six other photos, one of them blurred, nothing is found.
    """
    found = find_occluders(data.mesh, photo_set(data.cameras, data.photos), renderer)

    assert list(found) == ["2"]
    hidden = found["2"].free == 0
    with renderer.load(data.mesh) as scene:
        depth = scene.gbuffer(data.cameras[2], ("depth",)).require("depth")
    size = hidden.shape[::-1]
    on_mesh, piece = (
        cv2.resize(image.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
        for image in (np.isfinite(depth), data.masks[2])
    )
    kernel = np.ones((3, 3), np.uint8)
    visitor = cv2.erode((on_mesh & ~piece).astype(np.uint8), kernel, iterations=2) > 0
    assert 0.1 < visitor.sum() / on_mesh.sum() < 0.3
    assert hidden[visitor].mean() > 0.998
    assert (hidden & piece).sum() < 0.02 * piece.sum()


def test_vertices_are_near_the_truth(data, renderer):
    """Vertex colors are right where the vertices are dense enough for the paint: their median
    error stays under what an eye sees side by side.
    """
    errors = in_a_new_picture(colored("vertices", data, renderer), renderer)
    assert 1.5 < errors.median < 3.5
    assert errors.p95 < 13


def test_the_defects_are_not_harmless(data, renderer, textured):
    """The plain mean of the same photos is far off the truth: what the test above measures is the
    correction.
    """
    plain = in_a_new_picture(colored("texture", data, renderer, PLAIN), renderer)
    assert plain.median > 1.5 * textured.median
    assert plain.p95 > 1.5 * textured.p95


def test_brightness_of_the_whole_is_a_gauge(data):
    """A model half as bright has the same errors, and the factor is told."""
    points = true_points(COARSE, 4000)
    linear = np.maximum(data.shaded, 0.01)
    found = []
    for factor in (1.0, 0.5):
        encoded = np.round(srgb_from_linear(factor * linear) * 65535).astype(np.uint16)
        found.append(surface_errors(ColoredMesh(data.mesh.vertices, data.mesh.faces, encoded),
                                    points))  # fmt: skip
    assert found[1].gain == pytest.approx(2 * found[0].gain, rel=0.01)
    assert found[1].median == pytest.approx(found[0].median, abs=0.02)
    assert found[0].median > 0.2

"""A material's roughness and mirror from all of its points, on points drawn by other models."""

import numpy as np
import pytest

from texproj.appearance.brdf import GGX, Lambert, Microfacet
from texproj.appearance.brdf.fresnel import Dielectric, Schlick
from texproj.appearance.brdf.model import from_angles, unit
from texproj.appearance.brdf.shadowing import Smith, lambda_ggx
from texproj.appearance.flash.observations import Observations
from texproj.appearance.flash.pooled import pooled
from texproj.appearance.flash.reflection import Angles, Material

POINTS, PHOTOS = 1000, 9
CLEAR = np.full(POINTS, 1.5, np.float32)


def shown(brdf, bent_deg=0.0, seed=0):
    """Observations of points all around, a flash 3 degrees beside the lens. bent_deg: by how much
    the normals of the second half are off.
    """
    rng = np.random.default_rng(seed)
    count = POINTS * PHOTOS
    eye = from_angles(1 - 0.6 * rng.random(count) ** 2, rng.uniform(0, 2 * np.pi, count))
    lamp = unit(eye + 0.05 * rng.standard_normal(eye.shape))
    point = np.repeat(np.arange(POINTS), PHOTOS)
    off = np.tan(np.radians(bent_deg)) * rng.standard_normal((POINTS, 2)) * (
        np.arange(POINTS)[:, None] >= POINTS // 2
    )  # fmt: skip
    normal = unit(np.column_stack([off, np.ones(POINTS)]))[point]
    color = rng.uniform(0.7, 1.0, (POINTS, 1))[point] * (0.8, 0.6, 0.4)
    rgb = brdf(lamp, eye, color) * lamp[:, 2:] * 2
    half = unit(lamp + eye)
    cosines = [np.einsum("ij,ij->i", normal, x) for x in (lamp, eye, half)]
    cosines.append(np.einsum("ij,ij->i", eye, half))
    nl, nv, nh, vh = (x.clip(0.05, 1).astype(np.float32) for x in cosines)
    none = np.zeros((count, 3), np.float32)
    return Observations(
        POINTS, point, np.tile(np.arange(PHOTOS), POINTS), rgb.astype(np.float32), 2 * nl,
        Angles(nl, nv, nh, vh), np.ones(count, np.float32), none, none > 0,
    )  # fmt: skip


def gold(lamp, eye, color):
    facets = Microfacet(GGX(0.45**2), Smith(lambda_ggx, 0.45**2, 0.45**2), Schlick(1.0))
    return facets.evaluate(lamp, eye)[:, None] * color


def stone(lamp, eye, color):
    facets = Microfacet(GGX(0.7**2), Smith(lambda_ggx, 0.7**2, 0.7**2), Dielectric(1.5))
    return Lambert(1.0).evaluate(lamp, eye)[:, None] * color + facets.evaluate(lamp, eye)[:, None]


def test_gold_is_told_where_it_lies_flat():
    """Where normals are off by 8 degrees it looks rougher, to all of the points and to those."""
    seen, label, start = shown(gold, 8), np.zeros(POINTS, int), [Material(0.5, True)]
    flat = np.arange(POINTS) < POINTS // 2

    asked = seen.of_points(np.flatnonzero(~flat))
    (bent,) = pooled(asked, label[~flat], start, CLEAR[~flat])
    (told,) = pooled(seen, label, start, CLEAR + np.float32(0.1) * flat)

    assert told.material.roughness == pytest.approx(0.45, abs=0.006)
    assert bent.material.roughness > 0.456


@pytest.mark.parametrize("start", [0.65, 0.85])
def test_rough_paint_is_told_whatever_the_grid_said(start):
    """Its edge and its mirror are fitted together: a wrong edge hides a wrong roughness."""
    seen, label = shown(stone), np.zeros(POINTS, int)

    (told,) = pooled(seen, label, [Material(start, False)], CLEAR)

    assert told.material.roughness == pytest.approx(0.7, abs=0.03)

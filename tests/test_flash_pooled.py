"""A material's roughness and mirror from all of its points, on points drawn by other models."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from texproj.appearance.brdf import GGX, Lambert, Microfacet
from texproj.appearance.brdf.fresnel import Dielectric, Schlick
from texproj.appearance.brdf.model import from_angles, unit
from texproj.appearance.brdf.shadowing import Smith, lambda_ggx
from texproj.appearance.flash.observations import Observations
from texproj.appearance.flash.pooled import flattened, pooled
from texproj.appearance.flash.reflection import Angles, Material

POINTS, PHOTOS, PARTS = 1000, 9, 8
CLEAR = np.full(POINTS, 1.5, np.float32)


def shown(brdf, bent_deg=0.0, seed=0):
    """Observations of points all around, a flash 3 degrees beside the lens. bent_deg: by how much
    the surface turns within what is seen of a point of the second half.
    """
    rng = np.random.default_rng(seed)
    count = POINTS * PHOTOS
    eye = from_angles(1 - 0.6 * rng.random(count) ** 2, rng.uniform(0, 2 * np.pi, count))
    lamp = unit(eye + 0.05 * rng.standard_normal(eye.shape))
    point = np.repeat(np.arange(POINTS), PHOTOS)
    color = rng.uniform(0.7, 1.0, (POINTS, 1))[point] * (0.8, 0.6, 0.4)
    rgb = np.zeros((count, 3))
    for _ in range(PARTS):
        turn = np.radians(bent_deg) * rng.standard_normal((count, 3)) * (1, 1, 0)
        part = Rotation.from_rotvec(turn * (point >= POINTS // 2)[:, None])
        wi, wo = part.apply(lamp), part.apply(eye)
        rgb += brdf(wi, wo, color) * wi[:, 2:].clip(0) * 2 / PARTS
    half = unit(lamp + eye)
    cosines = lamp[:, 2], eye[:, 2], half[:, 2], np.einsum("ij,ij->i", eye, half)
    angles = Angles(*(x.clip(0.05, 1).astype(np.float32) for x in cosines))
    none = np.zeros((count, 3), np.float32)
    return Observations(
        POINTS, point, np.tile(np.arange(PHOTOS), POINTS), rgb.astype(np.float32), 2 * angles.nl,
        angles, np.ones(count, np.float32), none, none > 0,
    )  # fmt: skip


def gold(lamp, eye, color):
    facets = Microfacet(GGX(0.45**2), Smith(lambda_ggx, 0.45**2, 0.45**2), Schlick(1.0))
    return facets.evaluate(lamp, eye)[:, None] * color


def stone(lamp, eye, color):
    facets = Microfacet(GGX(0.7**2), Smith(lambda_ggx, 0.7**2, 0.7**2), Dielectric(1.5))
    return Lambert(1.0).evaluate(lamp, eye)[:, None] * color + facets.evaluate(lamp, eye)[:, None]


def test_gold_is_told_where_it_lies_flat():
    """Where it turns by 8 degrees within a pixel it looks rougher."""
    seen, label = shown(gold, 8), np.zeros(POINTS, int)
    flat = np.float32(0.1) * (np.arange(POINTS) < POINTS // 2)

    looks = pooled(seen, label, [Material(0.5, True)])
    (is_,) = flattened(seen, label, looks, CLEAR + flat)
    (bent,) = flattened(seen, label, looks, CLEAR - flat)

    assert is_.roughness == pytest.approx(0.45, abs=0.006)
    assert bent.roughness > 0.48
    assert is_.material == looks[0].material


@pytest.mark.parametrize("start", [0.65, 0.85])
def test_rough_paint_is_told_whatever_the_grid_said(start):
    """Its edge and its mirror are fitted together: a wrong edge hides a wrong roughness."""
    seen, label = shown(stone), np.zeros(POINTS, int)

    (told,) = pooled(seen, label, [Material(start, False)])

    assert told.material.roughness == pytest.approx(0.7, abs=0.03)
